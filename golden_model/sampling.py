"""The rays of a texel update: where they start, where they go, and what share of the irradiance each one stands for.

An update of a texel traces `directions` rays for indirect light, distributed as the cosine, and `light_samples` shadow
rays. Successive updates of a texel take successive runs of the same low-discrepancy sequences, so that together they
are better spread than independent samples, and the running average becomes smooth quickly.
"""

from dataclasses import dataclass

import numpy as np

from golden_model.directions import COUNT, ROTATIONS, cosine_table, rotation_table, to_world
from golden_model.floats import flush, quiet
from golden_model.formats import RAY
from golden_model.lights import Lights, direct_candidates
from golden_model.random import hash_u32
from golden_model.vectors import add, scale

PI = np.float32(3.1415927)
_INDIRECT, _SHADOW = range(2)  # what a hash is for


@dataclass(frozen=True, kw_only=True)
class Update:
    """The texels that one frame samples, M of them, with all that their rays depend on."""

    texel: np.ndarray
    """Numbers of the texels, (M,) int64."""
    record: np.ndarray
    """Their TEXEL records (M,)."""
    number: np.ndarray
    """How many updates each has had, (M,): selects the run of the sequences."""
    seed: int
    """Of the whole render."""


def indirect_rays(update: Update, directions: int, offset: np.float32) -> np.ndarray:
    """RAY (M * directions,), texel by texel: cosine-distributed around the normal, from `offset` above the surface.

    `directions` is a power of two up to 4096. Update n of a texel takes the run n xor h of the table, h a hash of the
    texel, turned about the normal by an angle of the texel's own: so one texel runs through the whole table, pairs of
    its runs (and pairs of pairs) stay stratified, and neighbours do not share their errors.
    """
    hashed = hash_u32(update.texel, update.seed, _INDIRECT)
    runs = COUNT // directions
    run = (update.number.astype(np.uint32) ^ (hashed & np.uint32(0xFFFF))) % np.uint32(runs)
    entry = run[:, None].astype(np.int64) * directions + np.arange(directions)
    rotation = rotation_table()[(hashed >> np.uint32(16)) % np.uint32(ROTATIONS)]
    start = add(update.record["position"], scale(update.record["normal"], offset))

    rays = np.zeros((len(update.texel), directions), dtype=RAY)
    rays["origin"] = start[:, None]
    rays["t_max"] = np.inf
    normal, tangent, turn = (
        np.repeat(a, directions, axis=0) for a in (update.record["normal"], update.record["tangent"], rotation)
    )
    direction = to_world(cosine_table()[entry.reshape(-1)], normal, tangent, turn)
    rays["direction"] = direction.reshape(len(update.texel), directions, 3)
    return rays.reshape(-1)


@quiet
def indirect_share(radiance: np.ndarray, directions: int) -> np.ndarray:
    """Radiance (R, 3) met by cosine-distributed rays to their contributions to irradiance: times pi / directions.

    The density is cosine / pi, so the mean of pi times the radiance is the irradiance. `directions` is a power of two,
    hence the factor is exact up to the rounding of pi.
    """
    return flush(radiance * (PI / np.float32(directions)))


def shadow_rays(update: Update, lights: Lights, light_samples: int) -> tuple[np.ndarray, np.ndarray]:
    """RAY (M * light_samples,), texel by texel, and what each contributes if nothing blocks it, (..., 3) float32.

    Rays that contribute nothing (light from behind) need not be traced. Update n takes the samples from
    n * light_samples on of the texel's own sequence.
    """
    rays, contribution = direct_candidates(
        lights,
        update.record["position"],
        update.record["normal"],
        hash_u32(update.texel, update.seed, _SHADOW),
        first=update.number.astype(np.int64) * light_samples,
        samples=light_samples,
    )
    return rays.reshape(-1), contribution.reshape(-1, 3)
