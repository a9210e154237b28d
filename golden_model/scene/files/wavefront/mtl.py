"""Wavefront MTL, the materials of an OBJ file: `Kd` is the albedo, `Ke` the emission.

What is missing or out of range is said, and a default takes its place: OBJ files are passed around without their
materials, and programs write colours that are a rounding error too large. Words are read in any case, as other readers
do; those that are not read and would be seen, or are not known, are said to be left out.
"""

import re
from pathlib import Path

import numpy as np

from lightloom.golden_model.host.errors import InputError, warn
from lightloom.golden_model.scene.files.named_files import lack
from lightloom.golden_model.scene.files.plain_text import differs, real
from lightloom.golden_model.scene.files.remarks import Remarks
from lightloom.golden_model.scene.files.wavefront.lines import LONGEST_WORD, lines
from lightloom.golden_model.scene.parts import DEFAULT_ALBEDO

Colours = tuple[list[float], list[float]]
"""Albedo and emission."""

NEUTRAL = {"ks": 0.0, "d": 1.0, "tr": 0.0, "tf": 1.0, "pm": 0.0, "pc": 0.0, "ps": 0.0}
"""What is not read, with the value that leaves a surface as it is without."""

UNSEEN = frozenset(("ka", "ns", "ni", "illum", "sharpness", "pr", "pcr", "aniso", "anisor"))
"""Words that change nothing of a diffuse surface without those above: ambient light, highlights, models of light."""


class Materials:
    """The materials of an OBJ file by name, from all its material files."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._read: dict[str, Colours] = {}
        self._used: dict[str, int] = {}
        self._files: set[Path] = set()

    def use(self, name: str, line: int) -> None:
        """Notes a `usemtl`; the file may name its material file only later."""
        if name:
            self._used.setdefault(name, line)

    def load(self, text: str, line: int) -> None:
        """Reads the files of a `mtllib` line: of several with a material of one name the first counts.

        Raises InputError for one that is damaged.
        """
        for name in _file_names(self.path.parent, text):
            file = self.path.parent / name
            if file in self._files:
                continue
            self._files.add(file)
            if state := lack(file):
                warn(f"{self.path}, line {line}: material file {file} is {state}; its materials become grey")
            else:
                found = _load_mtl(file)
                if twice := [name for name in found if name in self._read]:
                    warn(f"{file}: material {', '.join(twice)} is defined twice; that of the first file counts")
                self._read = found | self._read

    def colours(self) -> dict[str, Colours]:
        """Of all materials, "" the one that no file names; those that are used but nowhere defined are grey."""
        grey: Colours = (list(DEFAULT_ALBEDO), [0.0, 0.0, 0.0])
        missing = [name for name in self._used if name not in self._read]
        if missing:
            shown = ", ".join(f"{name} (line {self._used[name]})" for name in missing[:3])
            more = f" and {len(missing) - 3} more" if len(missing) > 3 else ""
            warn(f"{self.path}: material {shown}{more} is defined nowhere; it becomes grey")
        return dict.fromkeys(missing, grey) | self._read | {"": grey}


def _file_names(folder: Path, text: str) -> list[str]:
    """The names in a `mtllib` line: blanks separate them, and may be part of one."""
    if not text:
        return []
    text = text.replace("\\", "/")
    if not lack(folder / text):
        return [text]
    return re.findall(r"\S.*?\.mtl(?=\s|$)", text, flags=re.IGNORECASE) or text.split()


def _load_mtl(path: Path) -> dict[str, Colours]:
    """Materials by name. Raises InputError."""
    out: dict[str, Colours] = {}
    remarks = Remarks(path)
    twice: list[str] = []
    colours: Colours | None = None
    material = ""
    for line, written, text in lines(path):
        where = f"{path}, line {line}"
        key = written.lower()
        if key == "newmtl":
            twice += [text] if text in out else []
            material = text
            out[text] = colours = (list(DEFAULT_ALBEDO), [0.0, 0.0, 0.0])
        elif colours is None:
            remarks.leave_out("what stands before the first `newmtl`")
        elif key in ("kd", "ke"):
            values = text.split()
            colour = _colour(f"{where}: `{written}` of material {material}", values)
            most = 1 if key == "kd" else None
            what = f"line {line}: {written} {text} of material {material}"
            colours[key == "ke"][:] = remarks.clamped(colour, most, what)
            if len(values) > 3:
                remarks.leave_out(f"what follows the third number of `{written}`")
        elif key not in UNSEEN and (key not in NEUTRAL or differs(text.split(), NEUTRAL[key])):
            remarks.leave_out(f"`{written[:LONGEST_WORD]}`")
    remarks.say()
    if twice:
        warn(f"{path}: material {', '.join(dict.fromkeys(twice))} is defined twice; the last one counts")
    return out


def _colour(where: str, values: list[str]) -> np.ndarray:
    """Red, green, blue; one number is a grey. `where` begins the message of the InputError for all else."""
    if values[:1] in (["spectral"], ["xyz"]):
        raise InputError(f"{where} is given as `{values[0]}`, which is not read; give it red, green and blue")
    try:
        red, green, blue = (real(word) for word in (values * 3 if len(values) == 1 else values[:3]))
    except ValueError:
        raise InputError(f"{where} needs one or three numbers; the file may be damaged or cut off") from None
    return np.array([red, green, blue])
