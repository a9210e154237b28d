"""What of a mesh file is left out or changed: gathered while it is read, and said in a line for each kind."""

from pathlib import Path

import numpy as np

from lightloom.golden_model.host.errors import InputError, warn

MOST_NAMES = 20
"""Of what is left out; of a file of another kind each word may be a name."""


class Remarks:
    """Remarks on one file."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._left_out: dict[str, None] = {}
        self._clamped: dict[str, None] = {}
        self._changed: list[str] = []

    def leave_out(self, name: str) -> None:
        """Something that is not read, by the name that the format has for it; the same name counts once."""
        self._left_out[name] = None

    def leave_out_some(self, name: str) -> None:
        """What is needed of every corner or vertex, and is not there or cannot be used for one of them."""
        self.leave_out(f"{name} of objects in which one is missing or cannot be used")

    def clamped(self, colour: np.ndarray, most: float | None, what: str) -> list[float]:
        """A colour brought to 0 or more and, if there is a `most`, to that or less.

        Raises InputError where that leaves what is no float32: NaN, infinite or too large.
        """
        inside = np.clip(colour, 0, most)
        with np.errstate(over="ignore"):
            usable = np.isfinite(inside.astype(np.float32)).all()
        if not usable:
            raise InputError(f"{self.path}: {what} is NaN, infinite or too large; correct or remove it")
        if (inside != colour).any():
            self._clamped[what] = None
        return inside.tolist()

    def crossing(self, faces: int, first: str) -> None:
        """Polygons that cross themselves, which no triangles cover once; `first` is where the first one is."""
        if faces:
            number = f"faces that cross themselves, {faces} in all (first: {first})"
            self._changed.append(f"{number}, are cut into triangles as well as can be")

    def say(self) -> None:
        """Warns of what there is."""
        if self._left_out:
            names = list(self._left_out)
            more = f" and {len(names) - MOST_NAMES} more" if len(names) > MOST_NAMES else ""
            warn(f"{self.path}: left out: {', '.join(names[:MOST_NAMES])}{more}")
        if self._clamped:
            number = f"{len(self._clamped)} colour{'s' if len(self._clamped) > 1 else ''}"
            first = next(iter(self._clamped))
            warn(f"{self.path}: {number} out of range (first: {first}) brought to the nearest that can be")
        for line in self._changed:
            warn(f"{self.path}: {line}")
