"""The rays of a texel update: where they start, where they go, and what share of the irradiance each one stands for.

An update of a texel traces `directions` rays over the hemisphere, distributed as the cosine, and up to `light_samples`
shadow rays. Successive updates of a texel take successive runs of the same low-discrepancy sequences, so that together
they are better spread than independent samples, and the running average becomes smooth quickly.

Both kinds of ray can find an area light, the sun and a sky. Where they are `balanced` each counts for how likely it is
to: beside a light a shadow ray's sample would be a rare enormous one, and there the rays over the hemisphere do the
work.
"""

from dataclasses import dataclass

import numpy as np

from lightloom.golden_model.contract.formats import RAY
from lightloom.golden_model.numerics.counter_rng import hash_u32
from lightloom.golden_model.numerics.directions import COUNT, ROTATIONS, cosine_table, rotation_table, to_world
from lightloom.golden_model.numerics.floats import flush, quiet
from lightloom.golden_model.numerics.vectors import scale
from lightloom.golden_model.rays.light_samples import NO_RIVALS, direct_candidates, met_beyond, met_emission
from lightloom.golden_model.tables.lights import Lights

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


@dataclass(frozen=True, kw_only=True)
class TexelRays:
    """The rays of an update: R over the hemisphere and S towards lights, all of which are worth tracing."""

    indirect: np.ndarray
    """RAY (R,), for nearest hits, texel by texel."""
    indirect_slot: np.ndarray
    """Which of the update's M texels each belongs to, (R,) int64."""
    directions: np.ndarray
    """How many of them each texel has, (M,) int64."""
    shadow: np.ndarray
    """RAY (S,), for any hit, texel by texel: only those that bring light if nothing blocks them."""
    shadow_slot: np.ndarray
    """Which texel each belongs to, (S,) int64."""
    light: np.ndarray
    """What each shadow ray brings, (S, 3) float32."""
    light_samples: int
    """Shadow rays that were planned for each texel; the rest would bring nothing."""
    rivals: np.ndarray
    """`directions` over `light_samples`, (M,) float32, 0 where the two are not balanced; see `direct_candidates`."""

    def __len__(self) -> int:
        """Rays that are traced: what the update really costs, at most M * (directions + light_samples)."""
        return len(self.indirect) + len(self.shadow)


def texel_rays(
    update: Update, lights: Lights, directions: np.ndarray | int, light_samples: int, balanced: bool
) -> TexelRays:
    """All rays of an update. `directions` (M,), or one number for all: powers of two up to 4096.

    `light_samples` 0 leaves direct light out: then no ray counts the emission that it meets either.
    """
    count = np.broadcast_to(np.asarray(directions, dtype=np.int64), len(update.texel))
    rivals = np.full(len(count), NO_RIVALS)
    if balanced and light_samples:
        rivals = flush(count.astype(np.float32) / np.float32(light_samples))
    shadow, light = shadow_rays(update, lights, light_samples, rivals)
    carrying = np.flatnonzero(light.any(axis=1))
    return TexelRays(
        indirect=indirect_rays(update, count),
        indirect_slot=np.repeat(np.arange(len(count)), count),
        directions=count,
        shadow=shadow[carrying],
        shadow_slot=carrying // max(light_samples, 1),
        light=light[carrying],
        light_samples=light_samples,
        rivals=rivals,
    )


def indirect_rays(update: Update, directions: np.ndarray | int) -> np.ndarray:
    """RAY (R,), texel by texel: cosine-distributed around the normal.

    `directions` (M,), or one number for all, are powers of two up to 4096. Update n of a texel takes the run n xor h of
    the table, h a hash of the texel, turned about the normal by an angle of the texel's own: so one texel runs through
    the whole table, pairs of its runs (and pairs of pairs) stay stratified, and neighbours do not share their errors.
    """
    count = np.broadcast_to(np.asarray(directions, dtype=np.int64), len(update.texel))
    hashed = hash_u32(update.texel, update.seed, _INDIRECT)
    run = (update.number.astype(np.int64) ^ (hashed & np.uint32(0xFFFF)).astype(np.int64)) % (COUNT // count)
    within = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
    entry = np.repeat(run * count, count) + within
    of_texel = rotation_table()[(hashed >> np.uint32(16)) % np.uint32(ROTATIONS)]

    rays = np.zeros(len(entry), dtype=RAY)
    rays["t_max"] = np.inf
    rays["origin"], normal, tangent, rotation = (
        np.repeat(a, count, axis=0)
        for a in (update.record["position"], update.record["normal"], update.record["tangent"], of_texel)
    )
    rays["direction"] = to_world(cosine_table()[entry], normal, tangent, rotation)
    return rays


def light_met(update: Update, lights: Lights, rays: TexelRays, hits: np.ndarray) -> np.ndarray:
    """Emission that the rays over the hemisphere count of what they hit, HIT (R,), and of what lies beyond the scene
    where they hit nothing: radiance (R, 3) float32.

    Where shadow rays alone bring direct light (`rivals` 0) it is nothing, but for a sky that these do not look for.
    """
    radiance = np.zeros((len(hits), 3), dtype=np.float32)
    struck = np.flatnonzero(hits["primitive"] >= 0)
    slot = rays.indirect_slot[struck]
    radiance[struck] = met_emission(
        lights,
        hits["primitive"][struck],
        hits["front"][struck],
        scale(rays.indirect["direction"][struck], hits["t"][struck]),
        update.record["normal"][slot],
        rays.rivals[slot],
    )
    if lights.distant:
        missed = np.flatnonzero(hits["primitive"] < 0)
        slot = rays.indirect_slot[missed]
        radiance[missed] = met_beyond(
            lights, rays.indirect["direction"][missed], update.record["normal"][slot], rays.rivals[slot]
        )
    return radiance


@quiet
def indirect_share(radiance: np.ndarray, directions: np.ndarray | int) -> np.ndarray:
    """Radiance (R, 3) met by cosine-distributed rays to their contributions to irradiance: times pi / directions.

    The density is cosine / pi, so the mean of pi times the radiance is the irradiance. `directions`, (R,) or one for
    all, is a power of two, hence the factor is exact up to the rounding of pi.
    """
    return scale(radiance, np.broadcast_to(PI / np.asarray(directions).astype(np.float32), len(radiance)))


def shadow_rays(
    update: Update, lights: Lights, light_samples: int, rivals: np.ndarray | np.float32 = NO_RIVALS
) -> tuple[np.ndarray, np.ndarray]:
    """RAY (M * light_samples,), texel by texel, and what each contributes if nothing blocks it, (..., 3) float32.

    Rays that contribute nothing (light from behind) need not be traced. Update n takes the samples from
    n * light_samples on of the texel's own sequence. `rivals` as for `direct_candidates`.
    """
    rays, contribution = direct_candidates(
        lights,
        update.record["position"],
        update.record["normal"],
        hash_u32(update.texel, update.seed, _SHADOW),
        first=update.number.astype(np.int64) * light_samples,
        samples=light_samples,
        rivals=rivals,
    )
    return rays.reshape(-1), contribution.reshape(-1, 3)
