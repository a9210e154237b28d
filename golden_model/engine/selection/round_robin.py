"""The one way in which texels take turns: a cursor goes round a fixed order and takes members as they come."""

import numpy as np


class RoundRobin:
    """A cursor on an order of V places.

    Hardware finds the same places in one pass over the order, given how many members lie from the cursor on.
    """

    def __init__(self) -> None:
        self.next = 0
        """The place where the next search begins."""

    def upcoming(self, members: np.ndarray, count: int) -> np.ndarray:
        """The next `count` >= 0 places, or all, at which `members` (V,) bool is true, in the order of their turn."""
        places = np.flatnonzero(members)
        first = int(np.searchsorted(places, self.next))
        return np.concatenate([places[first:], places[:first]])[:count]

    def pass_over(self, place: int) -> None:
        """The next search begins after `place`."""
        self.next = int(place) + 1

    def take(self, members: np.ndarray, count: int) -> np.ndarray:
        """`upcoming`, and the cursor moves past the last one.

        So a place that is a member in each of several calls is taken once the counts add up to V, at the latest: each
        call moves the cursor by at least its count, or takes all members there are.
        """
        places = self.upcoming(members, count)
        if len(places):
            self.pass_over(places[-1])
        return places
