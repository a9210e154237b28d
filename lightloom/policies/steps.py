"""What becomes different all at once, and how long it takes until that is shown: lag.

A step is a change that is over in `STEP_FRAMES` frames, after which the scene stands still for at least a frame: a lamp
is switched, the camera cuts, an object appears. Lag is measured of steps of lights and of cuts.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from lightloom.golden_model.scene.pose import scene_at
from lightloom.golden_model.scene.scene import Scene
from lightloom.policies.still import still_frames

STEP_FRAMES = 2
"""A change that takes longer is a movement."""
BLOCK = 8
"""Pixels a side of the blocks whose means are compared: noise of single texels is no lag."""
REMAINING = 0.1
"""The part of a change that may be missing where it counts as shown."""
LEAST_CHANGE = 0.1
"""Of the light of a picture: a tenth of a smaller change cannot be told from noise, and its lag is not measured."""


@dataclass(frozen=True)
class Step:
    """A change that takes no time, and the still frames after it."""

    begin: int
    """The first frame that is different."""
    first: int
    """The first frame that shows all of the change."""
    last: int
    """The last frame before something changes again, or before the sequence ends."""
    followed: bool
    """Whether a light or the camera changed."""

    @property
    def edges(self) -> range:
        """The frames of which the reference has to be known: the last one before, and those of the change."""
        return range(self.begin - 1, self.first + 1)


def steps(scene: Scene, frames: int) -> list[Step]:
    """The steps among the first `frames` frames of a scene, in order."""
    still = still_frames(scene, frames)
    found = []
    number = 1
    while number < frames:
        begin = number
        while number < frames and number not in still:
            number += 1
        first = number - 1
        while number < frames and number in still:
            number += 1
        if first < number - 1 and 0 <= first - begin < STEP_FRAMES:
            found.append(Step(begin, first, number - 1, _light_or_camera(scene, begin - 1, first)))
    return found


def _light_or_camera(scene: Scene, before: int, after: int) -> bool:
    then, now = scene_at(scene, before), scene_at(scene, after)
    eyes = [(camera.position, camera.target) for camera in (scene.camera_at(before), scene.camera_at(after))]
    pairs = ((then.emission, now.emission), (then.point_lights, now.point_lights), *zip(*eyes, strict=True))
    return any(np.asarray(a).tobytes() != np.asarray(b).tobytes() for a, b in pairs)


@dataclass(frozen=True, kw_only=True)
class Seen:
    """What measures know of one frame, whatever the policy."""

    mapped: np.ndarray
    """The reference without straight light, (H, W, 3) float32."""
    straight: np.ndarray
    """Straight light, (H, W, 3) float32."""
    counted: np.ndarray
    """The pixels that count, (H, W) bool."""

    @property
    def whole(self) -> np.ndarray:
        """The reference, (H, W, 3) float32."""
        return self.mapped + self.straight


@dataclass
class Lag:
    """The lag of one step under each policy.

    Lag is the number of frames from `Step.begin` to the first from which on, to the end of the still frames, at most
    `REMAINING` of the change is missing: sum |I - R| <= `REMAINING` * sum |R - B|. R is the reference after the step, B
    the reference before it; all three are sums over blocks of `BLOCK` x `BLOCK` pixels, of those pixels that count in R
    and in B, without straight light.
    """

    step: Step
    before: Seen | None = None
    after: Seen | None = None
    missing: dict[str, list[float]] = field(default_factory=dict)
    """Of each policy the part of the change that is missing, from frame `Step.first` on."""

    def look(self, frame: int, images: Mapping[str, np.ndarray], seen: Seen | None) -> None:
        """Takes the pictures (H, W, 3) of a frame by policy; `seen` has to be there before the step and at its end."""
        if frame == self.step.begin - 1:
            self.before = seen
        if frame == self.step.first:
            self.after = seen
        if self.before is None or self.after is None or not self.step.first <= frame <= self.step.last:
            return
        counted = self.before.counted & self.after.counted
        wanted = blocks(self.after.mapped, counted)
        change = float(np.abs(wanted - blocks(self.before.mapped, counted)).sum())
        if change <= LEAST_CHANGE * float(wanted.sum()):
            return
        for name, image in images.items():
            shown = blocks(image - self.after.straight, counted)
            self.missing.setdefault(name, []).append(float(np.abs(shown - wanted).sum()) / change)

    def of(self, policy: str, turn: float) -> dict[str, Any] | None:
        """Lag of a policy in frames and in turns, a turn being `turn` frames; None where it is not measured.

        Where the change is not shown by the last still frame, `shown` is False, and the lag the frames looked at: it is
        longer than that.
        """
        if policy not in self.missing:
            return None
        late = [number for number, part in enumerate(self.missing[policy]) if not part <= REMAINING]
        frames = self.step.first - self.step.begin + (late[-1] + 1 if late else 0)
        shown = self.step.first + (late[-1] + 1 if late else 0) <= self.step.last
        return {"frame": self.step.begin, "frames": frames, "turns": frames / turn, "shown": shown}


def blocks(picture: np.ndarray, counted: np.ndarray) -> np.ndarray:
    """Sums over the blocks of a picture (H, W, 3), of its pixels that count (H, W): (rows, columns, 3) float64.

    Values that are not finite count as 0; blocks at the right and lower edge may be smaller.
    """
    values = np.where(counted[..., None], np.nan_to_num(picture.astype(np.float64), posinf=0, neginf=0), 0)
    rows, columns = (np.arange(0, size, BLOCK) for size in counted.shape)
    return np.asarray(np.add.reduceat(np.add.reduceat(values, rows, axis=0), columns, axis=1))


def longest(lags: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """What a summary says of the lags of a policy: the longest in frames and in turns, and how many never ended."""
    return {
        "lag": max((lag["frames"] for lag in lags), default=None),
        "lag_turns": max((lag["turns"] for lag in lags), default=None),
        "lags": len(lags),
        "never_shown": sum(not lag["shown"] for lag in lags),
    }
