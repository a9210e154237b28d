"""`lightloom irradiance`."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from lightloom.shared.options import Json, Scene, Seed, Traversal, npz

if TYPE_CHECKING:
    import numpy as np

POINTS = {"position": 3, "normal": 3}


def irradiance(
    scene: Scene,
    points: Annotated[Path, npz("--points", "P", "The points: position (N,3) and normal (N,3), float32.")],
    out: Annotated[Path, npz("--out", "E", "Where the result goes: irradiance (N,3) float32, RGB.")],
    samples: Annotated[int, typer.Option("--samples", metavar="N", help="Paths a point.")] = 1024,
    seed: Seed = 0,
    backend: Traversal = "auto",
    json: Json = False,
) -> None:
    """Irradiance of points in a scene, converged, without any lightmap.

    Direct and indirect light by path tracing, in the units of the scene's emission. Twice the noise at a quarter of
    the samples.

    \b
    Examples:
      lightloom irradiance cornell-box --points points.npz --out irradiance.npz
      lightloom irradiance room.glb --points points.npz --samples 16384 --out irradiance.npz
    """
    from functools import partial

    import numpy as np

    from lightloom.golden_model.host.outputs import whole_file
    from lightloom.golden_model.oracle.path_tracer import irradiance as converged
    from lightloom.golden_model.scene.files.load import load_scene
    from lightloom.golden_model.scene.scene import require_light
    from lightloom.golden_model.tracing.bvh.build import build
    from lightloom.golden_model.tracing.bvh.traversal import BACKENDS, trace
    from lightloom.shared.console import Progress, print_json, print_table
    from lightloom.shared.inputs import at_least, choose, save_arrays, seed_value

    choose(backend, BACKENDS, "backend")
    at_least(samples, 1, "--samples")
    position, normal = _points(points)
    stage = f"{len(position):,} points, {samples:,} paths each"
    with Progress() as progress:
        with progress.stage("Scene"):
            loaded = load_scene(scene)
            require_light(loaded)
            tracer = partial(trace, build(loaded.triangles), backend=backend)
        # Opened before the work, so that a place that cannot be written is found out before the work.
        with whole_file(out) as scratch, scratch.open("wb") as file:
            with progress.stage(stage, len(position) * samples) as advance:
                tell = _steps(advance)
                result = converged(loaded, tracer, position, normal, samples, seed_value(seed), tell)
            save_arrays(file, {"irradiance": result})
    mean = result.mean(axis=0, dtype=np.float64).tolist() if len(result) else []
    summary = {
        "points": len(position),
        "samples": samples,
        "mean_irradiance": mean,
        "seconds": progress.seconds[stage],
        "paths_per_second": len(position) * samples / progress.seconds[stage],
        "out": str(out),
    }
    if json:
        print_json(summary)
    else:
        row = {**summary, "mean_irradiance": " ".join(f"{value:.5g}" for value in mean)}
        print_table("Irradiance", [name.replace("_", " ") for name in row], [list(row.values())])


def _steps(advance: Callable[[float], None]) -> Callable[[int, int], None]:
    """Tells `advance`, which takes steps, of how much is done."""
    told = 0

    def tell(done: int, _: int) -> None:
        nonlocal told
        advance(done - told)
        told = done

    return tell


def _points(path: Path) -> "tuple[np.ndarray, np.ndarray]":
    """Positions and normals of length 1, (N, 3) float32 each, of a file. Raises InputError for what is neither."""
    import numpy as np

    from lightloom.golden_model.host.errors import InputError
    from lightloom.golden_model.numerics.vectors import normalize
    from lightloom.shared.inputs import read_arrays

    arrays = read_arrays(path, POINTS, "--points")
    position = arrays["position"]
    with np.errstate(all="ignore"):
        normal = normalize(arrays["normal"])
    unusable = np.flatnonzero(~np.isfinite(position).all(axis=1) | ~np.isfinite(normal).all(axis=1))
    if len(unusable):
        raise InputError(
            f"--points {path}: point {unusable[0]} has a position that is not finite or no usable normal; remove it"
        )
    return position, normal
