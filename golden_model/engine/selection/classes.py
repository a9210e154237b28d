"""Classes of texels, and how a frame's updates are shared out among them: a table, counters, no sorting.

Class c stands for a sampling rate of 2**c, relative to class 0, until every texel of a class is taken once a frame.
"""

from collections.abc import Sequence

import numpy as np

from lightloom.golden_model.contract.formats import FRAMES, ONE_SAMPLE
from lightloom.golden_model.engine.selection.policy import CLASSES, SHARE, Policy

IN_ORDER, OLD, FEW, NEVER = range(4)
"""Needs of a texel: none, not sampled for long, few samples in its average, none at all."""


def class_table(policy: Policy) -> np.ndarray:
    """The class for each combination, (4, 4, 4, 4, 4) uint8, indexed [lod, need, variability, change, degree].

    1024 entries of 4 bits: the sum of the policy's points, clipped to 0 to 15.
    """
    points = np.zeros((4, 4, 4, 4, 4), dtype=np.int64)
    points += np.array(policy.degree_points)
    points[..., 2:] += np.array(policy.change_points)[:, None]
    points[..., :2] += np.array(policy.hidden_change_points)[:, None]
    points += np.array(policy.variability_points)[:, None, None]
    points[..., 2:] += np.array(policy.need_points)[:, None, None, None]
    points[..., :2] += np.array(policy.hidden_need_points)[:, None, None, None]
    points += np.array(policy.lod_points)[:, None, None, None, None]
    return np.clip(points, 0, CLASSES - 1).astype(np.uint8)


def classes_of(table: np.ndarray, *what: np.ndarray) -> np.ndarray:
    """What the class table holds for texels, by its five indices, (N,) uint8 each of 0 to 3: (N,) uint8."""
    place = np.zeros(len(what[0]), dtype=np.uint16)
    for index in what:
        place <<= np.uint16(2)
        place |= index
    return table.reshape(-1)[place]


def needs(state: np.ndarray, frame: int, policy: Policy) -> np.ndarray:
    """TEXEL_STATE (N,) at a frame to IN_ORDER, OLD, FEW or NEVER, (N,) uint8: by count and by age ([0058]).

    Ages are modulo FRAMES, as the state holds them.
    """
    age = (np.uint16(frame % FRAMES) - state["frame"]) & np.uint16(FRAMES - 1)
    out = np.where(age >= policy.old, np.uint8(OLD), np.uint8(IN_ORDER))
    out = np.where(state["count"] < policy.few * ONE_SAMPLE, np.uint8(FEW), out)
    return np.where(state["count"] == 0, np.uint8(NEVER), out)


def quotas(members: Sequence[int], updates: int) -> list[int]:
    """Members of each class and a number of updates to the updates of each class; together min(updates, members).

    From the top class down: floor(R * 2**c * n / W) and at most n, where R is what is left of the updates and W the sum
    of 2**c * n over this class and those below. What the roundings leave goes to the top classes that have room.
    """
    weights = [count << c for c, count in enumerate(members)]
    left, weight = updates, sum(weights)
    out = [0] * len(members)
    for c in reversed(range(len(members))):
        if members[c]:
            out[c] = min(members[c], left * weights[c] // weight)
            left -= out[c]
            weight -= weights[c]
    for c in reversed(range(len(members))):
        more = min(members[c] - out[c], left)
        out[c] += more
        left -= more
    return out


class Share:
    """Whole updates that a share of all of them comes to, frame by frame; remainders are kept."""

    def __init__(self, share: int):
        """In 1/SHARE, 0 to SHARE."""
        self.share = share
        self.credit = 0
        """What has been earned and not had, in 1/SHARE of an update."""

    def of(self, updates: int, room: int) -> int:
        """The part of this frame's `updates`, at most `room`; what there is no room for waits.

        Over frames with X updates together, from any of them on, it comes to floor(X * share / SHARE) or more where
        there is always room for it. Of two shares, together at most SHARE, the second has the room that the first
        leaves, and comes to at most one update less: then the two credits never exceed 2 * SHARE - 2 together, because
        a frame without room spends all its updates on the two.
        """
        self.credit += updates * self.share
        whole = min(self.credit // SHARE, room)
        self.credit -= whole * SHARE
        return whole
