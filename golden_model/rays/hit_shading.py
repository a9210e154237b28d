"""What rays bring back ([0044], [0045], [0064], [0065]): the radiance of what they meet, and rays that go on.

A diffuse surface answers at once, from its lightmap. A mirror or a pane of glass answers by a further ray, or two: the
caller traces them as a new wave and weighs what they bring. So every emitter of rays works in the same waves: emit,
trace, shade, go on. `direct_at_hits` makes the shadow rays of a wave where the lightmaps hold no direct light.

Directions. A mirror reflects about the interpolated normal, so that a sphere of triangles looks round. Which side of
the surface the ray came from and where the new one may go is decided by the triangle: where the interpolated normal
does not face the ray, or would send the new ray through the wrong side, the triangle's own normal takes its place.

Glass. Refraction by Snell's law and the exact Fresnel reflectance for unpolarized light; total reflection follows from
them. The front of a triangle is where the medium is left, its back is inside; `ior` is the index of the inside over
that of the outside. Light that goes through takes on the tint at each passage; what is reflected does not. Radiance is
not scaled by the square of the index: on the way out of a closed body the factors cancel.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from lightloom.golden_model.contract.engine_image import DIFFUSE, GLASS
from lightloom.golden_model.contract.formats import RAY
from lightloom.golden_model.numerics.counter_rng import hash_u32, uniform
from lightloom.golden_model.numerics.floats import float_minmax, flush, quiet
from lightloom.golden_model.numerics.structured import take
from lightloom.golden_model.numerics.vectors import add, dot, normalize, scale
from lightloom.golden_model.rays.hit_surface import surface_at
from lightloom.golden_model.rays.light_samples import direct_candidates
from lightloom.golden_model.rays.surface_shading import INVERSE_PI, Surfaces, albedo_at, diffuse_radiance, emitted_at
from lightloom.golden_model.tables.geometry import Geometry
from lightloom.golden_model.tables.lights import Lights

_REFLECTED, _REFRACTED = 1, 2  # what a path's key is hashed with

Beyond = Callable[[np.ndarray], np.ndarray]
"""Directions (N, 3) float32, of any length, to the radiance that comes from beyond the scene, (N, 3) float32."""


@dataclass(frozen=True, kw_only=True)
class Onward:
    """Rays that go on from what others have met, K of them."""

    parent: np.ndarray
    """The ray that each follows, (K,) int64, rising; where one is followed by two the reflected one is first."""
    rays: np.ndarray
    """RAY (K,)."""
    weight: np.ndarray
    """Factor on what they bring, (K, 3) float32."""
    key: np.ndarray
    """Their paths' keys, (K,) uint32."""

    def __len__(self) -> int:
        return len(self.parent)

    def part(self, chosen: np.ndarray) -> "Onward":
        """Some of them, by their numbers or a mask."""
        return Onward(
            parent=self.parent[chosen], rays=take(self.rays, chosen), weight=self.weight[chosen], key=self.key[chosen]
        )


@dataclass(frozen=True, kw_only=True)
class Shaded:
    """A wave of N rays, shaded."""

    radiance: np.ndarray
    """What each brings by itself, (N, 3) float32."""
    onward: Onward
    """What follows those that met a mirror or glass."""


@dataclass(frozen=True, kw_only=True)
class Direct:
    """Shadow rays from what rays have met, K of them, all of which carry light if nothing blocks them."""

    parent: np.ndarray
    """The hit that each belongs to, (K,) int64, rising."""
    rays: np.ndarray
    """RAY (K,)."""
    value: np.ndarray
    """What each brings if it is not blocked, (K, 3) float32."""


def shade_rays(
    surfaces: Surfaces,
    rays: np.ndarray,
    hits: np.ndarray,
    key: np.ndarray,
    *,
    emission: bool,
    beyond: Beyond | None = None,
    both: bool = False,
    coarse: bool = False,
) -> Shaded:
    """Shades RAY (N,) with their HIT (N,), of the coarse geometry where `coarse`.

    Diffuse surfaces bring what their lightmap holds; `emission` says whether what shines counts as well: not where
    shadow rays have brought it already, always behind mirrors and glass, which shadow rays cannot pass. Misses
    bring what lies `beyond` the scene in their directions; without it, and as backs of diffuse surfaces do, nothing.

    At glass a ray is followed by the reflected and the refracted one where `both`; else by one of them, chosen by
    chance as the Fresnel reflectance has it, so that its weight is that of the tint alone. `key` (N,) uint32 is what
    makes a path's random choices its own.
    """
    geometry = surfaces.met(coarse)
    radiance = np.zeros((len(hits), 3), dtype=np.float32)
    struck = np.flatnonzero(hits["primitive"] >= 0)
    hit = take(hits, struck)
    radiance[struck] = diffuse_radiance(surfaces, hit, coarse=coarse)
    if emission:
        radiance[struck] = add(radiance[struck], emitted_at(surfaces, geometry, hit))
    if beyond is not None:
        missed = np.flatnonzero(hits["primitive"] < 0)
        radiance[missed] = beyond(rays["direction"][missed])
    specular = geometry.material(hit["primitive"])["surface"] != DIFFUSE
    parent, hit = struck[specular], take(hit, specular)
    tint = albedo_at(surfaces, geometry, hit)
    onward = scatter(geometry, rays["direction"][parent], hit, tint, key[parent], both=both)
    return Shaded(
        radiance=radiance,
        onward=Onward(parent=parent[onward.parent], rays=onward.rays, weight=onward.weight, key=onward.key),
    )


@quiet
def scatter(
    geometry: Geometry, direction: np.ndarray, hits: np.ndarray, tint: np.ndarray, key: np.ndarray, *, both: bool
) -> Onward:
    """The rays that follow rays of `direction` (N, 3) from HIT (N,) on mirrors and glass, of `tint` (N, 3).

    `both` and `key` as for `shade_rays`.
    """
    material = geometry.material(hits["primitive"])
    glass = material["surface"] == GLASS
    surface = surface_at(geometry.shapes, hits)
    facing, wall = surface.facing, surface.wall
    incoming = normalize(direction)
    # The interpolated normal has to face the ray; the triangle's own does, being the side that was hit.
    turned = dot(facing, incoming) < 0
    normal = np.where(turned[:, None], facing, wall)
    cosine = float_minmax(-dot(normal, incoming), np.float32(0), True)

    mirrored = add(incoming, scale(normal, flush(cosine + cosine)))
    own_cosine = float_minmax(-dot(wall, incoming), np.float32(0), True)
    astray = dot(mirrored, wall) <= 0
    mirrored = np.where(astray[:, None], add(incoming, scale(wall, flush(own_cosine + own_cosine))), mirrored)

    # Index of the side that the ray comes from over that of the other.
    ior = material["ior"]
    eta = np.where(hits["front"], flush(np.float32(1) / ior), ior)
    bent = _refracted(incoming, normal, cosine, eta)
    own = _refracted(incoming, wall, own_cosine, eta)
    astray = dot(bent, wall) >= 0
    bent = np.where(astray[:, None], own, bent)
    reflectance = np.where(glass, fresnel(cosine, eta), np.float32(1))
    passes = np.isfinite(bent).all(axis=1) & (reflectance < 1)

    tint_through = np.where(passes[:, None], tint, np.float32(0))
    tint_back = np.where(glass[:, None], np.float32(1), tint)
    if both:
        back = np.where(passes, reflectance, np.float32(1)) > 0
        weights = (
            scale(tint_back, np.where(passes, reflectance, np.float32(1))),
            scale(tint_through, flush(np.float32(1) - reflectance)),
        )
    else:
        back = ~passes | (uniform(hash_u32(key)) < reflectance)
        passes = ~back
        weights = (tint_back, tint_through)

    # Reflected and refracted of the same ray next to each other.
    chosen = np.flatnonzero(np.stack([back, passes], axis=1))
    parent, through = np.divmod(chosen, 2)
    rays = np.zeros(len(chosen), dtype=RAY)
    start = np.stack([surface.start, surface.start_behind], axis=1).reshape(-1, 3)
    rays["origin"] = start[chosen]
    rays["direction"] = np.stack([mirrored, bent], axis=1).reshape(-1, 3)[chosen]
    rays["t_max"] = np.inf
    weight = np.stack(weights, axis=1).reshape(-1, 3)[chosen]
    return Onward(
        parent=parent,
        rays=rays,
        weight=weight,
        key=hash_u32(key[parent], np.where(through == 1, _REFRACTED, _REFLECTED)),
    )


@quiet
def _refracted(incoming: np.ndarray, normal: np.ndarray, cosine: np.ndarray, eta: np.ndarray) -> np.ndarray:
    """Directions (N, 3) behind the surface by Snell's law, of unit `incoming` and `normal`; NaN where all is reflected.

    eta d + (eta c - sqrt(1 - eta^2 (1 - c^2))) n.
    """
    inner = _inner_cosine(cosine, eta)
    return add(scale(incoming, eta), scale(normal, flush(flush(eta * cosine) - inner)))


@quiet
def _inner_cosine(cosine: np.ndarray, eta: np.ndarray) -> np.ndarray:
    """Cosine of the refracted direction, (N,) float32; NaN where totally reflected."""
    sine2 = flush(flush(eta * eta) * flush(flush(np.float32(1) - cosine) * flush(np.float32(1) + cosine)))
    squared = flush(np.float32(1) - float_minmax(sine2, np.float32(0), True))
    return np.where(sine2 < 1, np.sqrt(squared), np.float32(np.nan))


@quiet
def fresnel(cosine: np.ndarray, eta: np.ndarray) -> np.ndarray:
    """Reflectance of a boundary between two media for unpolarized light, (N,) float32, 0 to 1.

    `cosine` (N,) of the incoming direction, 0 to 1; `eta` (N,) is the index where it comes from over that beyond. The
    mean of the squares of the two polarizations' amplitudes; 1 where all is reflected.
    """
    inner = _inner_cosine(cosine, eta)
    near, far = flush(eta * cosine), flush(eta * inner)
    across = flush(flush(near - inner) / flush(near + inner))
    along = flush(flush(cosine - far) / flush(cosine + far))
    mean = flush(flush(flush(across * across) + flush(along * along)) * np.float32(0.5))
    return float_minmax(mean, np.float32(1))


@quiet
def direct_light(
    geometry: Geometry,
    lights: Lights,
    hits: np.ndarray,
    key: np.ndarray,
    *,
    first: np.ndarray | int = 0,
    samples: int = 1,
) -> Direct:
    """The shadow rays of HIT (N,) that lie on a side of surfaces that reflects, with the irradiance that each brings.

    `samples` candidates a hit, from `first` on of the sequence that `key` (N,) chooses; those that can carry no light
    are left out. The sum of the values of those that arrive is the direct irradiance.
    """
    known = np.maximum(hits["primitive"], 0)
    lit = np.flatnonzero((hits["primitive"] >= 0) & geometry.reflects(known, hits["front"]))
    surface = surface_at(geometry.shapes, take(hits, lit))
    rays, light = direct_candidates(lights, surface.start, surface.facing, key[lit], first=first, samples=samples)
    light = light.reshape(-1, 3)
    carrying = np.flatnonzero(light.any(axis=1))
    return Direct(parent=lit[carrying // samples], rays=take(rays.reshape(-1), carrying), value=light[carrying])


@quiet
def direct_at_hits(
    surfaces: Surfaces,
    lights: Lights,
    hits: np.ndarray,
    key: np.ndarray,
    *,
    samples: int = 1,
    coarse: bool = False,
) -> Direct:
    """As `direct_light`, with the radiance that each ray lets its hit send back, for lightmaps without direct light."""
    geometry = surfaces.met(coarse)
    direct = direct_light(geometry, lights, hits, key, samples=samples)
    albedo = albedo_at(surfaces, geometry, take(hits, direct.parent))
    return replace(direct, value=flush(flush(albedo * INVERSE_PI) * direct.value))
