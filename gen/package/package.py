"""One folder for a fabrication or FPGA flow: Verilog, constraints, descriptions, testbenches, checksums."""

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from lightloom.gen.emit import emit
from lightloom.gen.manifest import PACKAGES
from lightloom.gen.package.files import constraints, ipxact, librelane, render, to_json, verilog_files
from lightloom.gen.package.formats import context
from lightloom.gen.package.memory import Case
from lightloom.gen.package.register_bench import register_bench
from lightloom.gen.package.registers import register_files
from lightloom.gen.package.stream_bench import stream_bench
from lightloom.gen.package.traversal_bench import scene, traversal_bench
from lightloom.golden_model.host.errors import InputError
from lightloom.golden_model.host.outputs import whole_folder
from lightloom.rtl.config import Config


@dataclass(frozen=True)
class OwnBench:
    """What units get that need more than operands."""

    testbench: Callable[[dict[str, Any], Config], dict[str, bytes]]
    """Manifest and configuration to files."""
    case: Callable[[Config], Case]
    """For the testbench of the unit behind a bus."""


OWN_BENCHES: Mapping[str, OwnBench] = {"traversal": OwnBench(traversal_bench, scene)}
SHORTEST, LONGEST = 0.01, 10_000.0
"""A clock's period in ns that is plausible."""


def package(
    units: Sequence[str] | None,
    config: Config,
    preset: str,
    clock: float,
    out: Path | str,
    *,
    prefix: str = "",
    bus: str = "",
    operands: Callable[[str], np.ndarray],
    memory_model: Path,
    progress: Callable[[str], None] = lambda unit: None,
) -> dict[str, Any]:
    """Writes the package of some units (none named: of the whole catalogue) into `out`; returns its manifest.

    `clock` is the period in ns that the constraints ask for; `prefix` begins the names of all modules. With a `bus`,
    units stand behind that. `operands` gives
    a unit's operands for its testbench, `memory_model` is the Verilog of the simulated memory. The folder appears whole
    or not at all; the same arguments give the same bytes. `progress` is told of every unit twice: emitted, done. Raises
    InputError for an unknown unit, a clock that cannot be meant and a folder that cannot be written.
    """
    if not SHORTEST <= clock <= LONGEST:
        raise InputError(f"--clock {clock:g}: a period in ns is {SHORTEST:g} to {LONGEST:g}")
    with whole_folder(out) as folder:
        manifests = emit(units, config, preset, folder / "rtl", prefix=prefix, bus=bus, progress=progress)
        (folder / "rtl" / ".lightloom").unlink()  # the marker of a folder of its own
        for unit in manifests:
            for name, content in _unit_files(unit, config, clock, operands).items():
                _write(folder / name, content)
            progress(unit["unit"])
        with_memory = [unit for unit in manifests if has_memory(unit)]
        if with_memory:
            _write(folder / "testbench" / memory_model.name, memory_model.read_bytes())
        for name, text in _shared_files(manifests, with_memory, preset, clock).items():
            _write(folder / name, text.encode())
        described = _manifest(folder, manifests, config, preset, clock)
        _write(folder / "manifest.json", to_json(described).encode())
        _write(folder / "SHA256SUMS", "".join(f"{_hash(folder / path)}  {path}\n" for path in _files(folder)).encode())
    return described


def _unit_files(
    unit: dict[str, Any], config: Config, clock: float, operands: Callable[[str], np.ndarray]
) -> dict[str, bytes]:
    """All files of one unit but its Verilog, by its module's name: path in the package to content."""
    name, module = unit["unit"], unit["module"]
    sdc = constraints(unit, clock)
    orfs = {"module": module, "files": verilog_files(unit), "unit_name": "ns"}
    texts = {
        f"sdc/{module}.sdc": sdc,
        f"ipxact/{module}.xml": ipxact(unit, version("lightloom")),
        f"flow/librelane/{module}/config.json": librelane(unit, clock),
        f"flow/openroad/{module}/config.mk": render("package_orfs.mk", **orfs),
        f"flow/openroad/{module}/constraint.sdc": sdc,
    }
    own = OWN_BENCHES.get(name)
    if "registers" in unit:
        bench = register_bench(unit, config, own.case(config) if own else operands(name))
    elif own:
        bench = own.testbench(unit, config)
    else:
        bench = stream_bench(unit, config, operands(name))
    files = {path: text.encode() for path, text in texts.items()}
    files |= {f"registers/{path}": content for path, content in register_files(unit, version("lightloom")).items()}
    return files | {f"testbench/{file}": content for file, content in bench.items()}


def _shared_files(
    manifests: list[dict[str, Any]], with_memory: list[dict[str, Any]], preset: str, clock: float
) -> dict[str, str]:
    modules = [unit["module"] for unit in manifests]
    sources = [file for unit in manifests for file in verilog_files(unit)]
    images = [unit["module"] for unit in with_memory]
    ties = dict.fromkeys(f"`{port['name']}`" for unit in manifests for port in unit["ports"] if port.get("tie") == 0)
    core = f"lightloom:{preset}:lightloom:{version('lightloom')}"
    return {
        "README.md": render(
            "package_readme.md",
            units=manifests,
            preset=preset,
            clock=f"{clock:g}",
            register_units=[unit["module"] for unit in manifests if "registers" in unit],
            ties=in_words(list(ties)),
        ),
        "Makefile": render("package_makefile", modules=modules),
        "lightloom.f": "".join(f"rtl/{file}\n" for file in sources),
        "lightloom.core": render("package.core", name=core, units=manifests, preset=preset, images=images),
        "include/lightloom_formats.h": render("package_formats.h", **context()),
    }


def _manifest(
    folder: Path, manifests: list[dict[str, Any]], config: Config, preset: str, clock: float
) -> dict[str, Any]:
    keys = ("unit", "module", "summary", "memories", "latency", "initiation_interval")
    return {
        "preset": preset,
        "clock_ns": clock,
        "config": config.flat(),
        "versions": {name: version(name) for name in PACKAGES},
        "units": [{key: unit[key] for key in keys} for unit in manifests],
        "files": {
            str(path): {"sha256": _hash(folder / path), "bytes": (folder / path).stat().st_size}
            for path in _files(folder)
        },
    }


def has_memory(unit: Mapping[str, Any]) -> bool:
    """Whether a unit, by its manifest, has a memory port."""
    return any(port["role"] == "memory" for port in unit["ports"])


def in_words(names: Sequence[str]) -> str:
    """ "a, b and c"."""
    return " and ".join(filter(None, [", ".join(names[:-1]), *names[-1:]]))


def _files(folder: Path) -> list[Path]:
    """Every file of the package by its path in it, in order, but the marker of `whole_folder`."""
    found = (path.relative_to(folder) for path in folder.rglob("*") if path.is_file())
    return sorted(path for path in found if path.name != ".lightloom")


def _hash(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _write(path: Path, content: bytes) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(content)
