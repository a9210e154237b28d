"""Pictures of a comparison of policies: where a picture errs, and what a policy knows of the texels, on the scene."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lightloom.golden_model.contract.formats import FRAMES
from lightloom.golden_model.pictures.images import write_png
from lightloom.golden_model.pictures.texel_views import colours, map_view, preview
from lightloom.golden_model.renderer import FrameResult
from lightloom.golden_model.tables.lightmap import Lightmaps

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
ERROR_RANGE = 0.5
"""Relative error at the ends of the colour scale."""
ERROR_FLOOR = 0.05
"""What is darker than this part of the mean luminance of the pixels that count is taken for as bright: black has no
relative error."""
ERROR_ANCHORS = (
    (-1.0, (178, 226, 255)),
    (-0.55, (48, 140, 220)),
    (-0.2, (22, 60, 110)),
    (0.0, (20, 21, 24)),
    (0.2, (112, 50, 16)),
    (0.55, (236, 126, 28)),
    (1.0, (255, 232, 168)),
)
"""Colours of the scale: blue too dark, orange too bright, nearly black none; lightness grows alike to both sides."""
TEXEL_PIXELS = 3
"""Pixels a side that a texel has in pictures of the maps."""
LEGEND_STEPS = 12
"""Colours that stand for a continuous scale."""
UNKNOWN_AGE = 65535
"""Age of a texel that was never sampled."""


def relative_error(image: np.ndarray, reference: np.ndarray, counted: np.ndarray) -> np.ndarray:
    """Signed relative error of the luminance of linear pictures (H, W, 3): (H, W) float64, negative: too dark.

    `counted` (H, W) bool are the pixels whose mean the floor is a part of: lamps in view would raise it.
    """
    shown, wanted = (luminance(picture) for picture in (image, reference))
    floor = ERROR_FLOOR * float(wanted[counted].mean()) if counted.any() else 0.0
    return (shown - wanted) / np.maximum(wanted, floor) if floor > 0 else np.zeros_like(wanted)


def luminance(picture: np.ndarray) -> np.ndarray:
    """(H, W, 3) to (H, W) float64; values that are not finite count as 0."""
    colour = np.nan_to_num(picture.astype(np.float64), posinf=0.0, neginf=0.0)
    return colour[..., 0] * LUMINANCE[0] + colour[..., 1] * LUMINANCE[1] + colour[..., 2] * LUMINANCE[2]


def error_colours(error: np.ndarray) -> np.ndarray:
    """Relative errors (...) to colours (..., 3) uint8, by the scale from -ERROR_RANGE to ERROR_RANGE."""
    places = [place for place, _ in ERROR_ANCHORS]
    scaled = np.clip(error / ERROR_RANGE, -1, 1)
    channels = [np.interp(scaled, places, [colour[k] for _, colour in ERROR_ANCHORS]) for k in range(3)]
    return np.rint(np.stack(channels, axis=-1)).astype(np.uint8)


@dataclass(frozen=True, kw_only=True)
class Quantity:
    """Something that is known of every texel, as a picture over the scene."""

    name: str
    title: str
    about: str
    low: float
    high: float
    palette: str
    unit: str = ""
    open: bool = False
    """What lies above `high` is shown as `high`."""
    labels: tuple[str, ...] = ()
    """What the whole numbers from `low` on mean; none: the quantity is continuous."""
    values: Callable[[FrameResult, np.ndarray], np.ndarray]
    """(result of the frame, TEXEL_STATE (N,) after it) to (N,)."""


def ages(state: np.ndarray, frame: int) -> np.ndarray:
    """Frames since the last update of each texel, (N,) int64; `UNKNOWN_AGE` for those that have no sample."""
    age = (frame - state["frame"].astype(np.int64)) % FRAMES
    return np.where(state["count"] > 0, age, UNKNOWN_AGE)


QUANTITIES = (
    Quantity(
        name="priority",
        title="Priority",
        about="The class that the policy gives a texel: each one up is sampled twice as often.",
        low=0,
        high=15,
        palette="inferno",
        unit="class",
        values=lambda result, state: result.maintenance.plan.priority,
    ),
    Quantity(
        name="degree",
        title="Visibility",
        about="The degree to which a texel can be seen, from the normal, depth and ray tests and the coming viewpoint.",
        low=0,
        high=3,
        palette="viridis",
        labels=("cannot be seen", "hidden now", "likely", "seen"),
        values=lambda result, state: result.maintenance.plan.degree,
    ),
    Quantity(
        name="variability",
        title="Variability",
        about="The bin of a texel: deviation between updates, spread of the rays of one, contrast to its neighbours.",
        low=0,
        high=3,
        palette="viridis",
        labels=("uniform", "low", "medium", "high"),
        values=lambda result, state: result.maintenance.plan.bins,
    ),
    Quantity(
        name="change",
        title="Change",
        about="Where light becomes different: volumes of influence around what changes, and texels that noticed it.",
        low=0,
        high=3,
        palette="viridis",
        labels=("none", "weak", "medium", "strong"),
        values=lambda result, state: result.maintenance.plan.change,
    ),
    Quantity(
        name="age",
        title="Age",
        about="Frames since a texel was last sampled; one that never was counts as the oldest.",
        low=0,
        high=64,
        palette="inferno",
        unit="frames",
        open=True,
        values=lambda result, state: ages(state, result.frame),
    ),
    Quantity(
        name="deviation",
        title="Deviation",
        about="Running mean of how far a new sample lies from the texel's average.",
        low=0,
        high=50,
        palette="inferno",
        unit="%",
        open=True,
        values=lambda result, state: state["deviation"].astype(np.float32) * np.float32(100 / 256),
    ),
)


def write_quantity(
    folder: Path, quantity: Quantity, lightmaps: Lightmaps, result: FrameResult, state: np.ndarray
) -> None:
    """Writes `folder`/name.png, the quantity over the frame's scene, and name-maps.png, all maps side by side."""
    values = quantity.values(result, state)
    scale = quantity.low, quantity.high, quantity.palette
    write_png(folder / f"{quantity.name}.png", preview(lightmaps, result.gbuffer, values, *scale))
    write_png(folder / f"{quantity.name}-maps.png", map_view(lightmaps, values, *scale, pixels=TEXEL_PIXELS))


def legend(quantity: Quantity) -> list[str]:
    """Colours of a quantity's scale from low to high, as CSS has them: one a label, or `LEGEND_STEPS`."""
    places = np.linspace(quantity.low, quantity.high, len(quantity.labels) or LEGEND_STEPS)
    return [_css(colour) for colour in colours(places, quantity.low, quantity.high, quantity.palette)]


def error_legend() -> list[str]:
    """Colours of the scale of errors from -ERROR_RANGE to ERROR_RANGE."""
    return [_css(colour) for colour in error_colours(np.linspace(-ERROR_RANGE, ERROR_RANGE, LEGEND_STEPS + 1))]


def _css(colour: np.ndarray) -> str:
    """(3,) uint8 as #rrggbb."""
    return "#" + "".join(f"{int(channel):02x}" for channel in colour)
