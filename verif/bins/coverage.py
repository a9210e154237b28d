"""Functional coverage: how often a bench has seen each of the things that it should see.

A thing is a bin, bins of one subject are a group: {"input held": 12, "input idle": 0}. A group names all of its bins,
those with nothing in them too, so that what was never seen is known. Bins come in whole groups out of arrays and of
recorded cycles, not sample by sample, which is why this is all there is to it.
"""

import json
import os
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

BINS = "LIGHTLOOM_BINS"
"""Environment variable: the file that a bench adds its groups to, a line of JSON each."""

Groups = dict[str, dict[str, int]]
"""Groups of bins, by name."""
SIDE = ("idle", "moves", "held")
"""What a stream does in a cycle: nothing is offered, a transfer, or something is offered and not taken."""
HELD_LONG = 20
"""Cycles without a break."""


def note(groups: Callable[[], Groups]) -> None:
    """Adds groups to the file that BINS names; where it names none, nobody wants them and they are not made."""
    if path := os.environ.get(BINS):
        with Path(path).open("a", encoding="utf-8") as file:
            file.write(json.dumps(groups()) + "\n")


def noted(path: Path) -> Groups:
    """All groups in such a file, added up."""
    return together(json.loads(line) for line in path.read_text(encoding="utf-8").splitlines())


def together(parts: Iterable[Mapping[str, Mapping[str, int]]]) -> Groups:
    """Groups of the same name added up, bin by bin."""
    out: Groups = {}
    for part in parts:
        for group, bins in part.items():
            total = out.setdefault(group, {})
            for name, count in bins.items():
                total[name] = total.get(name, 0) + int(count)
    return out


def cases(**masks: Any) -> dict[str, int]:
    """A group out of masks (N,): how many hold. An underscore in a name stands for a space."""
    return {name.replace("_", " "): int(np.count_nonzero(mask)) for name, mask in masks.items()}


# --- streams ----------------------------------------------------------------------------------------------------------


class StreamCycles:
    """What an input and an output stream did, cycle by cycle; `names` are theirs."""

    def __init__(self, *names: str) -> None:
        self.names = names or ("input", "output")
        self._inputs: list[int] = []
        self._outputs: list[int] = []

    def add(self, offered: bool, accepted: bool, valid: bool, ready: bool) -> None:
        """One cycle of both sides."""
        self._inputs.append((1 if accepted else 2) if offered else 0)
        self._outputs.append((1 if ready else 2) if valid else 0)

    def groups(self) -> Groups:
        """Both sides at once, each side from cycle to cycle, and how long it was held.

        What is held stays offered, so "held, then idle" does not exist; a bench fails where it sees that.
        """
        both = Counter(zip(self._inputs, self._outputs, strict=True))
        out: Groups = {
            " and ".join(self.names): {f"{a}, {b}": both[i, o] for i, a in enumerate(SIDE) for o, b in enumerate(SIDE)}
        }
        for side, states in zip(self.names, (self._inputs, self._outputs), strict=True):
            steps = Counter(pairwise(states))
            out[side] = {
                f"{a}, then {b}": steps[i, j]
                for i, a in enumerate(SIDE)
                for j, b in enumerate(SIDE)
                if (a, b) != ("held", "idle")
            }
            runs = "".join(map(str, states)).replace("0", " ").replace("1", " ").split()
            out[side]["held for one cycle"] = sum(len(run) == 1 for run in runs)
            out[side][f"held for {HELD_LONG} cycles"] = sum(len(run) >= HELD_LONG for run in runs)
        return out
