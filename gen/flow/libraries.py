"""Cell libraries: which liberty files a mapping reads, and where the open PDKs keep theirs.

No file of a PDK is part of this project; its user says where it is.
"""

import gzip
import re
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from lightloom.golden_model.host.errors import InputError

CELL = re.compile(r"^\s*cell\s*\(", re.MULTILINE)
STATE = re.compile(r"^\s*(?:ff|latch|statetable)\s*\(", re.MULTILINE)
FLIP_FLOP = re.compile(r"^\s*ff\s*\(", re.MULTILINE)

PIN = re.compile(r"^\s*pin\s*\(\s*\"?(\w+)\"?\s*\)", re.MULTILINE)


@dataclass(frozen=True)
class Library:
    """A cell library at one corner; its files are plain text by now."""

    name: str
    """What tables call it, such as "ihp-sg13g2 typ"."""
    files: tuple[Path, ...]
    period: float
    """The clock period that is asked for where the user does not say, in ns."""

    @property
    def file_names(self) -> list[str]:
        return [path.name for path in self.files]


@dataclass(frozen=True)
class Pdk:
    """Where a PDK's liberty files are: patterns of names for each corner, and a clock period in ns to ask for."""

    corners: dict[str, tuple[str, ...]]
    periods: dict[str, float]


def _asap7(corner: str) -> tuple[str, ...]:
    return tuple(f"asap7sc7p5t_{kind}_RVT_{corner}_nldm_*.lib" for kind in ("SEQ", "SIMPLE", "INVBUF", "AO", "OA"))


PDKS = {
    "ihp-sg13g2": Pdk(
        {"typ": ("sg13g2_stdcell_typ_1p20V_25C.lib",), "slow": ("sg13g2_stdcell_slow_1p08V_125C.lib",)},
        {"typ": 5.0, "slow": 8.0},
    ),
    "asap7": Pdk({"typ": _asap7("TT"), "slow": _asap7("SS")}, {"typ": 1.0, "slow": 1.6}),
}
"""The PDKs that are known by name. A corner is looked for in every folder below the root that the user gives."""

PERIOD = 5.0
"""For liberty files that the user names."""


def of_pdk(name: str, root: Path, corner: str) -> tuple[str, list[Path], float]:
    """Name, liberty files and default period of a PDK below `root`. Raises InputError where a file is not there."""
    pdk = PDKS[name]
    if corner not in pdk.corners:
        raise InputError(f"--corner {corner}: {name} has {' and '.join(pdk.corners)}")
    if not root.is_dir():
        raise InputError(f"--pdk-root {root}: no such folder")
    files = []
    for pattern in pdk.corners[corner]:
        # The newest of several versions; the same file twice in a PDK is of one content.
        found = sorted([*root.rglob(pattern), *root.rglob(f"{pattern}.gz")], key=lambda path: (path.name, str(path)))
        if not found:
            raise InputError(f"--pdk-root {root}: holds no {pattern} (or .gz), which {name} {corner} needs")
        files.append(found[-1])
    return f"{name} {corner}", files, pdk.periods[corner]


def unpack(name: str, sources: Sequence[Path], period: float, folder: Path) -> Library:
    """Copies liberty files into `folder`, unpacked, so that tools find them. Raises InputError for one that is none."""
    files: dict[str, Path] = {}
    for source in sources:
        try:
            content = source.read_bytes()
            if source.suffix == ".gz":
                content = gzip.decompress(content)
        except (OSError, EOFError, zlib.error) as error:
            raise InputError(f"{source}: cannot be read ({getattr(error, 'strerror', None) or error})") from error
        if not CELL.search(content.decode(errors="replace")):
            raise InputError(f"{source}: holds no cell; give a liberty file of standard cells")
        file = folder / source.name.removesuffix(".gz")
        if file.name in files:
            raise InputError(f"{source}: a second file of this name; give each liberty file once")
        file.write_bytes(content)
        files[file.name] = file
    library = Library(name, tuple(files.values()), period)
    if not sequential(library):
        raise InputError(f"{library.name}: no cell is a flip-flop; give the liberty file that has them too")
    if not combinational(library):
        raise InputError(f"{library.name}: no cell is a gate; give the liberty file that has them too")
    return library


def sequential(library: Library) -> list[str]:
    """Names of the files that hold flip-flops."""
    return [path.name for path in library.files if FLIP_FLOP.search(path.read_text(errors="replace"))]


def combinational(library: Library) -> list[str]:
    """Names of the files that hold gates: cells without a state."""
    names = []
    for path in library.files:
        text = path.read_text(errors="replace")
        if len(CELL.findall(text)) > len(STATE.findall(text)):
            names.append(path.name)
    return names
