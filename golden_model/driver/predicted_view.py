"""The viewpoint of frames to come, so that texels about to appear are sampled before they do ([0074], FIG. 15)."""

from dataclasses import replace

import numpy as np

from lightloom.golden_model.engine.selection.policy import Policy
from lightloom.golden_model.numerics.floats import flush, quiet
from lightloom.golden_model.scene.scene import Camera, Scene
from lightloom.golden_model.tables.pinhole import View, look_at


@quiet
def extrapolated(before: Camera, now: Camera, frames: int) -> Camera:
    """Where a camera is `frames` frames later if it goes on as from the last frame to this one, in straight lines."""
    ahead = np.float32(frames)

    def onward(old: np.ndarray, new: np.ndarray) -> np.ndarray:
        return flush(new + flush(flush(new - old) * ahead))

    return replace(now, position=onward(before.position, now.position), target=onward(before.target, now.target))


def predicted_view(scene: Scene, frame: int, width: int, height: int, policy: Policy) -> View | None:
    """The view of frame + `prediction`, in fewer pixels than the frame's `width` x `height`.

    With `prediction_known` from the scene's own camera of that frame, which is determined before it is rendered; else
    from the cameras of this frame and the one before. None where nothing is predicted: the policy does not want it,
    or the camera stays.
    """
    now = scene.camera_at(frame)
    if not policy.visibility or policy.prediction == 0:
        return None
    if policy.prediction_known:
        camera = scene.camera_at(frame + policy.prediction)
    else:
        camera = extrapolated(scene.camera_at(max(frame - 1, 0)), now, policy.prediction)
    if (camera.position == now.position).all() and (camera.target == now.target).all():
        return None
    if (camera.position == camera.target).all():
        return None
    columns, rows = (-(-side // policy.prediction_scale) for side in (width, height))
    return look_at(camera.position, camera.target, camera.up, camera.fov_y_tan, columns, rows)
