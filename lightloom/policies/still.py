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


def jump(before: np.ndarray, after: np.ndarray, exposure: float) -> float:
    """The part of the pixels of linear pictures (H, W, 3) whose display changes by more than STEP in a channel."""
    shown = [tonemap(picture, exposure).astype(np.int16) for picture in (before, after)]
    return float((np.abs(shown[1] - shown[0]).max(axis=-1) > STEP).mean())
