"""The pinhole camera in numbers that the rasterizer and the ray generators use."""

from dataclasses import dataclass

import numpy as np

from lightloom.golden_model.contract.formats import RAY
from lightloom.golden_model.host.errors import InputError
from lightloom.golden_model.numerics.floats import flush, quiet
from lightloom.golden_model.numerics.vectors import cross, dot, normalize, scale

LARGEST_SIDE = 16384  # pixels; with the guard band of the rasterizer, screen coordinates stay within 24 bits


@dataclass(frozen=True, kw_only=True)
class View:
    """A camera looking at one frame. Pixel (x, y) has its centre at (x + 0.5, y + 0.5); x to the right, y down."""

    position: np.ndarray
    """The eye, (3,) float32, world units."""
    right: np.ndarray
    """Unit vector along +x of the picture, (3,) float32."""
    up: np.ndarray
    """Unit vector along -y of the picture, (3,) float32."""
    forward: np.ndarray
    """Unit vector along the view axis; depth is measured along it, (3,) float32."""
    focal: np.float32
    """Distance of the picture plane in pixels."""
    near: np.float32
    """Depth of the near plane, world units; what lies nearer is not drawn."""
    width: int
    """Pixels."""
    height: int
    """Pixels."""


@quiet
def look_at(
    position: np.ndarray, target: np.ndarray, up: np.ndarray, fov_y_tan: np.float32 | float, width: int, height: int
) -> View:
    """The view from `position` to `target` ((3,) float32 each); `fov_y_tan` is tan of half the vertical field of view.

    The near plane lies at 2**-10 of the distance between the two.
    Raises InputError for a size outside 1..16384 and for a camera that looks nowhere.
    """
    if not (1 <= width <= LARGEST_SIDE and 1 <= height <= LARGEST_SIDE):
        raise InputError(f"--size {width}x{height}: each side must be 1 to {LARGEST_SIDE} pixels")
    position, target, up = (flush(np.asarray(v, dtype=np.float32)) for v in (position, target, up))
    toward = flush(target - position)
    forward = normalize(toward)
    right = normalize(cross(forward, up))
    focal = flush(np.asarray(np.float32(height) * np.float32(0.5) / np.float32(fov_y_tan)))
    if not (np.isfinite(right).all() and np.isfinite(forward).all() and np.isfinite(focal) and focal > 0):
        raise InputError(
            "camera: position and target must differ, up must not point along the view, 0 < fov_y_tan < infinity"
        )
    return View(
        position=position,
        right=right,
        up=cross(right, forward),
        forward=forward,
        focal=np.float32(focal),
        near=np.float32(flush(np.sqrt(dot(toward, toward)) * np.float32(2.0**-10))),
        width=width,
        height=height,
    )


@quiet
def to_view(view: View, points: np.ndarray) -> np.ndarray:
    """World points (..., 3) to view space (..., 3): x to the right, y up, z the depth."""
    out = np.empty(np.shape(points), dtype=np.float32)
    # One coordinate at a time, each in an array of its own: a third of the time.
    moved = [flush(flush(np.ascontiguousarray(points[..., k])) - view.position[k]) for k in range(3)]
    for k, axis in enumerate((view.right, view.up, view.forward)):
        product = [flush(moved[j] * axis[j]) for j in range(3)]
        out[..., k] = flush(flush(product[0] + product[1]) + product[2])
    return out


@quiet
def pixel_rays(view: View) -> np.ndarray:
    """One RAY through each pixel centre, (height * width,), row by row from the top; t is the depth of the point."""
    x = flush((np.arange(view.width, dtype=np.float32) + np.float32(0.5) - np.float32(view.width / 2)) / view.focal)
    y = flush((np.float32(view.height / 2) - np.arange(view.height, dtype=np.float32) - np.float32(0.5)) / view.focal)
    rays = np.zeros((view.height, view.width), dtype=RAY)
    across = scale(view.right, x)[None, :, :]
    down = scale(view.up, y)[:, None, :]
    rays["origin"] = view.position
    rays["direction"] = flush(flush(view.forward + across) + down)
    rays["t_min"] = view.near
    rays["t_max"] = np.inf
    return rays.reshape(-1)
