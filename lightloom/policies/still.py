"""Frames in which nothing changes, and what flickers in them all the same."""

import numpy as np

from lightloom.golden_model.pictures.images import tonemap
from lightloom.golden_model.scene.pose import scene_at, state_of
from lightloom.golden_model.scene.scene import Scene

STEP = 8
"""Of 255: a pixel that changes by more from one frame to the next is seen to."""


def still_frames(scene: Scene, frames: int) -> set[int]:
    """The frames, of the first `frames`, that show the same scene from the same place as the one before."""
    seen = [_shown(scene, number) for number in range(frames)]
    return {number for number in range(1, frames) if seen[number] == seen[number - 1]}


def _shown(scene: Scene, number: int) -> tuple[bytes, ...]:
    """All that can change from frame to frame, as bytes."""
    camera = scene.camera_at(number)
    return *state_of(scene_at(scene, number)), camera.position.tobytes(), camera.target.tobytes()


def rest(scene: Scene, first: int, length: int, end: int) -> int | None:
    """The first frame from `first` on that is the last of `length` in which nothing changes, or None.

    Frames from `end` on are not looked at.
    """
    still = still_frames(scene, end)
    run = 1  # frame 0 begins a stretch
    for number in range(1, end):
        run = run + 1 if number in still else 1
        if run >= length and number >= first:
            return number
    return None


def still_from(still: set[int]) -> set[int]:
    """The frames that those of `still` (`still_frames`) are all like: each the last before some of them."""
    return {number - 1 for number in still if number - 1 not in still}


def jump(before: np.ndarray, after: np.ndarray, wanted: np.ndarray, exposure: float) -> float:
    """The part of the pixels whose display changes by more than STEP in a channel and comes no nearer to what it ought.

    Of linear pictures (H, W, 3), nearness by the sum over the channels. A change of light that is shown late is
    a lag and no jump: what still is on its way may take steps of any size towards the picture `wanted`.
    """
    shown, now, aim = (tonemap(picture, exposure).astype(np.int16) for picture in (before, after, wanted))
    moved = np.abs(now - shown).max(axis=-1) > STEP
    nearer = np.abs(now - aim).sum(axis=-1) < np.abs(shown - aim).sum(axis=-1)
    return float((moved & ~nearer).mean())
