"""The same bits on films and on layouts of the suite, however and wherever they are computed: long.

`test_frame_loop` and `test_any_host` ask the same of small scenes in every run of the tests.
"""

from dataclasses import replace
from hashlib import sha256
from typing import Any

import pytest

from lightloom.golden_model.charts.curved import default_cache
from lightloom.golden_model.charts.unwrap import unwrap
from lightloom.golden_model.engine.sampling.settings import Sampling
from lightloom.golden_model.engine.selection.policy import POLICIES
from lightloom.golden_model.renderer import Renderer
from lightloom.golden_model.scene.files.load import load_scene
from lightloom.golden_model.scene.scene import Scene
from lightloom.golden_model.stimuli.layouts.catalogue import LAYOUTS, write_layout
from lightloom.golden_model.structures.structure import Structure
from lightloom.golden_model.tables.lightmap import Lightmaps
from tests import ROOT
from tests.golden_model.changed_hosts import casts_are_errors, nans_are_random, texels_are_shuffled
from tests.needs import needs_numba

SEED = 8
SIZE = 96, 64
BUDGET = 3_000
FRAMES = 14
"""From the first on: in this time most things in films and layouts have begun to move."""
FILMS = sorted(path.stem for path in (ROOT / "scenes").glob("*.toml"))

pytestmark = pytest.mark.long


@pytest.fixture(scope="module", params=[*(f"film {name}" for name in FILMS), *LAYOUTS])
def scene(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[Scene, Lightmaps, str]:
    """A film or a layout, its maps, and what its frames come to with numba on one thread."""
    kind, _, name = request.param.rpartition(" ")
    film = ROOT / "scenes" / f"{name}.toml"
    path = film if kind else write_layout(name, SEED, tmp_path_factory.mktemp("layout"))
    loaded = load_scene(str(path))
    maps = unwrap(loaded, trace=Structure(loaded).trace, cache=default_cache())
    return loaded, maps, fingerprint(loaded, maps)


def fingerprint(scene: Scene, maps: Lightmaps, backend: str = "numba", threads: int = 1, **policy: Any) -> str:
    """Of all that frames leave behind."""
    width, height = SIZE
    renderer = Renderer(
        scene,
        lightmaps=maps,
        width=width,
        height=height,
        budget=BUDGET,
        seed=SEED,
        sampling=Sampling(priming=4),
        policy=replace(POLICIES["influence"], **policy),
        backend=backend,
        threads=threads,
    )
    digest = sha256()
    for _ in range(FRAMES):
        frame = renderer.frame()
        for part in (frame.image, frame.gbuffer, frame.lightmap, renderer.state, frame.maintenance.texels):
            digest.update(part.tobytes())
    return digest.hexdigest()


@needs_numba
@pytest.mark.parametrize(("backend", "threads"), [("numpy", 1), ("numba", 2)])
def test_on_any_backend_and_number_of_threads(scene: tuple[Scene, Lightmaps, str], backend: str, threads: int) -> None:
    loaded, maps, once = scene
    assert fingerprint(loaded, maps, backend, threads) == once


@needs_numba
def test_without_culling(scene: tuple[Scene, Lightmaps, str]) -> None:
    loaded, maps, once = scene
    assert fingerprint(loaded, maps, cull=False) == once


@needs_numba
def test_with_admitted_texels_in_any_order(
    scene: tuple[Scene, Lightmaps, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    loaded, maps, once = scene
    texels_are_shuffled(monkeypatch, SEED)
    assert fingerprint(loaded, maps) == once, f"seed {SEED}"


@needs_numba
def test_with_any_nan(scene: tuple[Scene, Lightmaps, str], monkeypatch: pytest.MonkeyPatch) -> None:
    """NumPy alone: the twins have no NaN of their own to scramble."""
    loaded, maps, once = scene
    nans_are_random(monkeypatch, SEED)
    assert fingerprint(loaded, maps, "numpy") == once, f"seed {SEED}"


def test_where_casts_saturate(scene: tuple[Scene, Lightmaps, str], monkeypatch: pytest.MonkeyPatch) -> None:
    loaded, maps, once = scene
    with casts_are_errors(monkeypatch):
        assert fingerprint(loaded, maps, "numpy") == once
