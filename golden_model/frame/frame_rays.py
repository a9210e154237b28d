"""The rays of a frame that its pixels ask for ([0043], [0045], [0059]): reflection, refraction, occlusion of lights.

Two emitters make them from the G-buffer, once it is known what each pixel sees:

- fragment shading: where the visible surface is a mirror or glass its material asks for the reflected and refracted
  rays;
- the frame shader, a pass over all pixels: where the lightmaps hold no direct light, shadow rays from each diffuse
  pixel to the lights, so that shadows are as sharp as the picture.

Results are added to the ray buffer; the blender weighs them by the pixel's surface (`surface_shading.ray_weights`).
Rays that meet mirrors and glass again go on in further waves. `FrameRays` holds a frame's rays between the waves, so
that they share the collector's waves with lightmap maintenance; `trace_frame` runs them by themselves.
"""

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from lightloom.golden_model.contract.engine_image import DIFFUSE, MIRROR
from lightloom.golden_model.contract.formats import HIT
from lightloom.golden_model.frame.ray_buffer import RayBuffer
from lightloom.golden_model.host.errors import InputError
from lightloom.golden_model.numerics.counter_rng import hash_u32
from lightloom.golden_model.numerics.floats import flush, quiet
from lightloom.golden_model.numerics.structured import take
from lightloom.golden_model.rays.collector import FRAGMENT_SHADING, FRAME_SHADER, Collector
from lightloom.golden_model.rays.hit_shading import Beyond, Onward, direct_at_hits, direct_light, scatter, shade_rays
from lightloom.golden_model.rays.surface_shading import Surfaces, textured
from lightloom.golden_model.tables.lights import Lights
from lightloom.golden_model.tables.pinhole import View, pixel_rays

_SPECULAR, _SHADOW, _BEYOND = range(3)  # what a hash is for


@dataclass(frozen=True, kw_only=True)
class FrameShading:
    """Which rays the pixels of a frame send."""

    direct: Literal["maps", "rays"] = "maps"
    """Whether direct light is in the lightmaps, or comes by shadow rays from every pixel and every hit."""
    shadow_samples: int = 4
    """Shadow rays of a diffuse pixel, 1 to 64."""
    hit_samples: int = 1
    """Shadow rays where a reflected or refracted ray meets a diffuse surface, 1 to 16."""
    bounces: int = 6
    """Mirrors and panes of glass that a path from the eye may meet, the visible one included, 0 to 16."""
    split: int = 2
    """Of these the first so many send both the reflected and the refracted ray, the others one of them, 0 to 8."""
    cutoff: float = 2.0**-9
    """Rays of which no more than this would reach the eye are not traced, 0 to 0.5."""
    coarse_specular: bool = False
    """Whether reflected and refracted rays meet the reduced geometry, where the scene has one ([0055])."""
    coarse_shadow: bool = False
    """Whether shadow rays do."""

    def __post_init__(self) -> None:
        if self.direct not in ("maps", "rays"):
            raise InputError(f"direct {self.direct}: must be maps or rays")
        for name, low, high in (("shadow_samples", 1, 64), ("hit_samples", 1, 16), ("bounces", 0, 16), ("split", 0, 8)):
            if not low <= getattr(self, name) <= high:
                raise InputError(f"{name.replace('_', ' ')} {getattr(self, name)}: must be {low} to {high}")
        if not 0 <= self.cutoff <= 0.5:
            raise InputError(f"cutoff {self.cutoff}: must be 0 to 0.5")


@dataclass(kw_only=True)
class FrameRayFigures:
    """Rays of a frame by what they are for."""

    specular: int = 0
    """Reflected and refracted."""
    shadow: int = 0
    """From pixels to lights."""
    hit_shadow: int = 0
    """From what reflected and refracted rays have met to lights."""
    waves: int = 0
    dropped: int = 0
    """Not traced, because too little would reach the eye or because the path had met its last mirror."""
    clipped: int = 0
    """What rays brought that was brighter than the buffer holds: light that is lost."""

    @property
    def total(self) -> int:
        """Rays traced."""
        return self.specular + self.shadow + self.hit_shadow


@dataclass
class _Shadows:
    """Shadow rays on their way: their pixels, and what each brings if nothing blocks it."""

    pixel: np.ndarray
    value: np.ndarray
    ticket: int


@dataclass
class _Specular:
    """Reflected and refracted rays: the next to be traced, or on their way."""

    pixel: np.ndarray
    onward: Onward
    weight: np.ndarray  # (K, 3): what of their radiance reaches the buffer
    ticket: int = -1


@dataclass
class _Waiting:
    """What the next wave will emit."""

    specular: _Specular | None = None
    shadows: list[tuple[str, np.ndarray, np.ndarray, np.ndarray]] = field(default_factory=list)


class FrameRays:
    """The rays that the pixels of one frame have sent, wave by wave.

    `while rays.emit(collector): collector.run(); rays.receive(collector)`; other emitters may emit in between.
    """

    def __init__(
        self,
        surfaces: Surfaces,
        view: View,
        gbuffer: np.ndarray,
        lights: Lights,
        fraction: int,
        options: FrameShading | None = None,
        *,
        beyond: Beyond | None = None,
        seed: int = 0,
        frame: int = 0,
    ):
        """Of GBUFFER (H, W). `fraction` is that of the buffer; `seed` and `frame` choose the samples.

        `beyond` as for `shade_rays`.
        """
        self.options = options or FrameShading()
        self.figures = FrameRayFigures()
        self.buffer = RayBuffer(gbuffer.shape[0], gbuffer.shape[1], fraction)
        self._surfaces, self._lights, self._beyond = surfaces, lights, beyond
        self._bounce = 0  # mirrors that the paths on their way have met
        self._flying: tuple[_Specular | None, list[_Shadows]] = (None, [])
        flat = gbuffer.reshape(-1)
        geometry = surfaces.geometry
        seen = np.flatnonzero(flat["primitive"] >= 0)
        surface = geometry.material(flat["primitive"][seen])["surface"]
        self._next = _Waiting()
        specular = seen[surface != DIFFUSE]
        if len(specular):
            self._material_rays(view, take(flat, specular), specular, hash_u32(specular, seed, frame, _SPECULAR))
        if self.options.direct == "rays" and len(lights):
            diffuse = seen[geometry.reflects(flat["primitive"][seen], flat["front"][seen])]
            self._occlusion_rays(take(flat, diffuse), diffuse, hash_u32(diffuse, seed, _SHADOW), frame)

    def _material_rays(self, view: View, fragment: np.ndarray, pixel: np.ndarray, key: np.ndarray) -> None:
        """What mirrors and glass that pixels see ask for. A mirror's tint is left to the blender."""
        geometry, primitive = self._surfaces.geometry, fragment["primitive"]
        mirror = geometry.material(primitive)["surface"] == MIRROR
        tint = textured(self._surfaces, geometry, primitive, fragment["texture"], fragment["texture_lod"])
        tint = np.where(mirror[:, None], np.float32(1), tint)
        direction = pixel_rays(view)["direction"][pixel]
        onward = scatter(geometry, direction, _seen(fragment), tint, key, both=self.options.split > 0)
        self._go_on(pixel[onward.parent], onward, onward.weight)

    def _occlusion_rays(self, fragment: np.ndarray, pixel: np.ndarray, key: np.ndarray, frame: int) -> None:
        """Shadow rays of diffuse pixels; what they bring to the buffer is irradiance."""
        samples = self.options.shadow_samples
        direct = direct_light(
            self._surfaces.geometry, self._lights, _seen(fragment), key, first=frame * samples, samples=samples
        )
        self._next.shadows.append((FRAME_SHADER, pixel[direct.parent], direct.rays, direct.value))
        self.figures.shadow += len(direct.rays)

    def _go_on(self, pixel: np.ndarray, onward: Onward, weight: np.ndarray) -> None:
        """Puts rays into the next wave, but those that are not worth it."""
        self._bounce += 1
        enough = np.asarray((weight > np.float32(self.options.cutoff)).any(axis=1))
        if self._bounce > self.options.bounces:
            enough[:] = False
        kept = np.flatnonzero(enough)
        self.figures.dropped += len(enough) - len(kept)
        if len(kept):
            self._next.specular = _Specular(pixel[kept], onward.part(kept), weight[kept])
            self.figures.specular += len(kept)

    def emit(self, collector: Collector) -> bool:
        """Hands the next wave to the collector; False if there is none."""
        waiting, self._next = self._next, _Waiting()
        if waiting.specular is not None:
            rays = waiting.specular.onward.rays
            waiting.specular.ticket = collector.emit(FRAGMENT_SHADING, rays, coarse=self.options.coarse_specular)
        shadows = []
        for emitter, pixel, rays, value in waiting.shadows:
            ticket = collector.emit(emitter, rays, any_hit=True, coarse=self.options.coarse_shadow)
            shadows.append(_Shadows(pixel, value, ticket))
        self._flying = waiting.specular, shadows
        more = waiting.specular is not None or bool(shadows)
        self.figures.waves += more
        return more

    @quiet
    def receive(self, collector: Collector) -> None:
        """Takes the results of the wave: adds to the buffer what they bring and prepares the next wave."""
        specular, shadows = self._flying
        self._flying = None, []
        self._add_shadows(collector, shadows)
        if specular is not None:
            self._shade(collector, specular)
        self.figures.clipped = self.buffer.clipped

    def _add_shadows(self, collector: Collector, shadows: list[_Shadows]) -> None:
        for shadow in shadows:
            arrived = np.flatnonzero(collector.hits(shadow.ticket)["primitive"] < 0)
            self.buffer.add(shadow.pixel[arrived], shadow.value[arrived])

    def _shade(self, collector: Collector, specular: _Specular) -> None:
        options, onward, coarse = self.options, specular.onward, self.options.coarse_specular
        hits = collector.hits(specular.ticket)
        both = self._bounce < options.split
        shaded = shade_rays(
            self._surfaces, onward.rays, hits, onward.key, emission=True, beyond=self._beyond, both=both, coarse=coarse
        )
        self.buffer.add(specular.pixel, flush(specular.weight * shaded.radiance))
        if options.direct == "rays" and len(self._lights):
            key = hash_u32(onward.key, _BEYOND)
            direct = direct_at_hits(self._surfaces, self._lights, hits, key, samples=options.hit_samples, coarse=coarse)
            value = flush(specular.weight[direct.parent] * direct.value)
            self._next.shadows.append((FRAGMENT_SHADING, specular.pixel[direct.parent], direct.rays, value))
            self.figures.hit_shadow += len(direct.rays)
        further = shaded.onward
        if len(further):
            weight = flush(specular.weight[further.parent] * further.weight)
            self._go_on(specular.pixel[further.parent], further, weight)


def _seen(fragment: np.ndarray) -> np.ndarray:
    """GBUFFER (N,) as HIT (N,) of rays from the eye along the view axis's depth."""
    hits = np.zeros(len(fragment), dtype=HIT)
    for name, source in (("primitive", "primitive"), ("t", "depth"), ("u", "u"), ("v", "v"), ("front", "front")):
        hits[name] = fragment[source]
    return hits


def trace_frame(rays: FrameRays, collector: Collector) -> RayBuffer:
    """Runs all waves of a frame's rays by themselves and returns the buffer."""
    while rays.emit(collector):
        collector.run()
        rays.receive(collector)
    return rays.buffer
