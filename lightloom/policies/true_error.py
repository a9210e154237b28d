"""E true: how far a picture at rest is from a path-traced one, which reads no map.

E of `lightloom.policies.judge` is against converged maps, which leak, clip and blur as the maps themselves do. E true
sees these, too: E true = sum |I - T| / sum T, over the sums of blocks of 8 x 8 pixels, of those pixels that count,
without straight light; T is path-traced from each pixel's own point (`golden_model.oracle.true_picture`). It is taken
in the last of at least `STILL` frames in which nothing changes, so that it is what maintenance comes to.

T is two pictures with random numbers of their own, T1 and T2, and their mean; its noise, sum |T1 - T2| / sum 2 T, is as
large as what its own error adds to an E true of nothing.

A path-traced picture depends neither on policy, nor on budget, nor on the seed of the render. It is kept under a key
of all that it depends on: what the frame shows and the program.
"""

import hashlib
from pathlib import Path
from typing import Any

import numpy as np

from lightloom.golden_model.charts.curved import default_cache
from lightloom.golden_model.host.errors import InputError
from lightloom.golden_model.host.fingerprint import fingerprint
from lightloom.golden_model.host.outputs import whole_file
from lightloom.golden_model.oracle import true_picture as oracle
from lightloom.golden_model.oracle.true_picture import require_path_traced, true_picture
from lightloom.golden_model.scene.scene import Scene
from lightloom.golden_model.structures.structure import Structure
from lightloom.policies.judge import counted_pixels
from lightloom.policies.steps import blocks
from lightloom.policies.still import rest
from lightloom.shared.console import Advance
from lightloom.shared.step_cache import key_of
from lightloom.sim.toolchain import locked

STILL = 60
"""Frames in which nothing changes before a picture is compared, at least, it among them."""
LONGEST = 1024
"""Frames after those of the comparison in which such a stretch is looked for."""
SEEDS = (0x7121E, 0x7121F)
"""Of the two path-traced pictures."""


def resting_frame(scene: Scene, frames: int) -> int:
    """The first frame at or after the last of `frames` that is the last of `STILL` frames in which nothing changes.

    Raises InputError for a scene that does not come to rest, and for one that cannot be path-traced.
    """
    require_path_traced(scene)
    found = rest(scene, frames - 1, STILL, frames + LONGEST)
    if found is None:
        raise InputError(
            f"--true: the scene is not still for {STILL} frames up to frame {frames + LONGEST}; leave it out"
        )
    return found


def true_pictures(
    scene: Scene, gbuffer: np.ndarray, samples: int, backend: str, advance: Advance, cache: Path | None = None
) -> np.ndarray:
    """Two path-traced pictures of a frame, `samples` / 2 paths a pixel each, (2, H, W, 3) float32; made or kept.

    Of the frame's scene (`scene_at`), in the file's own units of light, and its GBUFFER (H, W).

    They are kept in `cache`, or where charts are kept. `advance` is told of parts of the whole, 1.
    """
    cache = cache or default_cache()
    if cache is None:
        return _made(scene, gbuffer, samples, backend, advance)
    file = cache / "true" / f"{_key(scene, gbuffer, samples)}.npy"
    with locked(file):  # parallel cases make it once
        if not file.exists():
            made = _made(scene, gbuffer, samples, backend, advance)
            with whole_file(file) as part, part.open("wb") as opened:
                np.save(opened, made)
        return np.asarray(np.load(file))


def _made(scene: Scene, gbuffer: np.ndarray, samples: int, backend: str, advance: Advance) -> np.ndarray:
    trace = Structure(scene, backend).trace
    pictures = []
    for seed in SEEDS:
        told = 0.0

        def tell(done: int, total: int) -> None:
            nonlocal told
            now = done / total / len(SEEDS)
            advance(now - told)
            told = now

        half = samples // len(SEEDS)
        pictures.append(true_picture(scene, gbuffer, trace, half, seed, tell))
    return np.stack(pictures)


def _key(scene: Scene, gbuffer: np.ndarray, samples: int) -> str:
    """A name for the light of a frame, what its pixels see of it, the number of paths and the program."""
    digest = hashlib.sha256()
    arrays = (scene.triangles, scene.normals, scene.material, scene.albedo, scene.emission, scene.point_lights)
    others = (scene.two_sided, scene.cones, *scene.environment.arrays)
    seen = (gbuffer[name] for name in ("primitive", "u", "v", "front"))
    for array in (*arrays, *others, *seen):
        digest.update(f"{array.shape} {array.dtype}\n".encode() + np.ascontiguousarray(array).tobytes())
    return key_of(fingerprint(oracle.__name__), str(SEEDS), str(samples), digest.hexdigest())


def true_figures(
    image: np.ndarray, straight: np.ndarray, pictures: np.ndarray, among: np.ndarray | None = None
) -> dict[str, Any]:
    """E true, energy ratio and noise of a picture (H, W, 3), given its straight light and two path-traced pictures.

    Only pixels `among` (H, W) bool count, if that is given. None where the path-traced pictures are black.
    """
    wanted = pictures.astype(np.float64).mean(axis=0)
    counted = counted_pixels(straight, straight + wanted)
    if among is not None:
        counted &= among
    first, second = (blocks(picture, counted) for picture in pictures)
    shown, reference = blocks(image - straight, counted), (first + second) / 2
    total = float(reference.sum())
    if not total > 0:
        return dict.fromkeys(("true_error", "true_energy", "true_noise"))
    return {
        "true_error": float(np.abs(shown - reference).sum()) / total,
        "true_energy": float(shown.sum()) / total,
        "true_noise": float(np.abs(first - second).sum()) / (2 * total),
    }
