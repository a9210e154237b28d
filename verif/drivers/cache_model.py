"""The block cache as a model, for requests that come one at a time: what is in it, as far as anybody can know."""

from typing import Any

from lightloom.verif.drivers.stepped import Values

BLOCK_NUMBER_BITS = 32
Line = tuple[int, bool]
"""A block, and whether it was hit since it came. An empty line is (-1, False)."""
EMPTY: Line = (-1, False)
Content = tuple[Line, ...]
"""The lines of a set, in any order: sorted."""


class CacheModel:
    """Steps are requests: `block`, and whether the memory `fails` to give it; seen are `hit` and `evicted`.

    Which of the lines that may go is given to a block is chosen at random. So the model keeps every content that a set
    may have by what was seen of it; where no content is left, the hardware has done what no choice explains.
    """

    def __init__(self, *, sets: int, ways: int) -> None:
        self.bits, self.ways = (sets - 1).bit_length(), ways
        self.sets: list[set[Content]] = [{(EMPTY,) * ways} for _ in range(sets)]
        self._asked = 0

    def state(self) -> Values:
        """The possible contents of the set of the last request, of which there are few."""
        return {"set": self._asked, "may hold": sorted(self.sets[self._asked])}

    def step(self, operands: Values, seen: Values) -> Values:
        block = operands["block"]
        self._asked = row = self._set_of(block)
        outcomes = [each for content in self.sets[row] for each in self._outcomes(content, block, operands["fails"])]
        allowed = [(hit, evicted) for hit, evicted, _ in outcomes]
        was = (bool(seen["hit"]), bool(seen["evicted"]))
        hit, evicted = was if was in allowed else allowed[0]
        self.sets[row] = {content for *how, content in outcomes if tuple(how) == (hit, evicted)}
        return {"hit": hit, "evicted": evicted}

    def _set_of(self, block: int) -> int:
        row = 0
        for first in range(0, BLOCK_NUMBER_BITS, self.bits or BLOCK_NUMBER_BITS):
            row ^= block >> first & ((1 << self.bits) - 1)
        return row

    def _outcomes(self, content: Content, block: int, fails: bool) -> list[tuple[bool, bool, Content]]:
        """Of a content: whether the block is in it, whether another has to go, and what is there then."""
        if any(each == block for each, _ in content):
            return [(True, False, _sorted((each, used or each == block) for each, used in content))]
        unused = [k for k, (_, used) in enumerate(content) if not used]
        # Where all were used, any may go, and all count as not used.
        kept = content if unused else tuple((each, False) for each, _ in content)
        came = EMPTY if fails else (block, False)
        return [
            (False, kept[k][0] >= 0, _sorted(came if k == way else line for way, line in enumerate(kept)))
            for k in unused or range(self.ways)
        ]


def _sorted(lines: Any) -> Content:
    return tuple(sorted(lines))
