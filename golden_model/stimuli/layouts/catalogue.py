"""The suite: its layouts, seeds and budgets. What a default is chosen by; frozen, so that figures can be compared."""

import zlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import tomli_w

from lightloom.golden_model.stimuli.layouts import changes, open_air, rooms
from lightloom.golden_model.stimuli.layouts.description import Description

SEEDS = (0, 1, 2)
BUDGETS = {"scarce": 8_000, "plenty": 28_000}
"""Rays a frame: some 1.5 and 5 a texel."""


@dataclass(frozen=True)
class Layout:
    """A kind of scene, of which every seed gives another."""

    name: str
    make: Callable[[np.random.Generator], Description]

    @property
    def about(self) -> str:
        """What it shows, in a line."""
        return (self.make.__doc__ or "").strip()

    def of_seed(self, seed: int) -> Description:
        """The same for the same seed, whatever other layouts there are."""
        return self.make(np.random.default_rng([zlib.crc32(self.name.encode()), seed]))


_MADE = (
    *(rooms.room, rooms.arcade, rooms.arcade_walk, rooms.corridor, rooms.corridor_walk),
    *(rooms.thin_walls, rooms.meeting_boxes, rooms.curves),
    *(changes.few_movers, changes.many_movers, changes.crossing, changes.cut, changes.flicker, changes.torch),
    *(changes.dimmer, changes.appearing, changes.door, changes.hundred_lights),
    open_air.village,
)
LAYOUTS = {each.name: each for each in (Layout(make.__name__.replace("_", "-"), make) for make in _MADE)}


def write_layout(name: str, seed: int, folder: Path) -> Path:
    """Writes NAME-SEED.toml, and the mesh files that it names, into a folder; returns its path."""
    description = LAYOUTS[name].of_seed(seed)
    path = folder / f"{name}-{seed}.toml"
    for table in description.tables["mesh"]:
        text = description.files[table["file"]]
        table["file"] = f"{name}-{seed}-{table['file']}"
        (folder / table["file"]).write_text(text, encoding="utf-8")
    path.write_text(tomli_w.dumps({"name": path.stem} | description.finished()), encoding="utf-8")
    return path
