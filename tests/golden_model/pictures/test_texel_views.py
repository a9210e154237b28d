"""Previews: the right texel's colour at the right pixel, the palette's ends, the maps as one picture."""

import numpy as np
import pytest

from lightloom.golden_model.contract.engine_image import MIRROR
from lightloom.golden_model.pictures.texel_views import (
    BACKGROUND,
    NO_TEXEL,
    PALETTES,
    colours,
    map_view,
    nearest_texels,
    preview,
    preview_colours,
)
from lightloom.golden_model.tables.lightmap import VALID
from tests.golden_model.frame_scenes import ball, quad, room, scene_of, seen_from


def test_palettes_run_from_low_to_high() -> None:
    values = np.array([-9, 0, 0.5, 1, 9, np.nan, np.inf])
    for name in PALETTES:
        if name == "names":
            continue
        out = colours(values, 0, 1, name)
        assert (out[0] == out[1]).all()
        assert (out[3] == out[4]).all()
        assert (out[6] == out[3]).all()
        assert (out[5] == out[0]).all()
        assert (out[0] != out[3]).any()
    viridis = colours(np.linspace(0, 1, 50), 0, 1)
    brightness = viridis @ np.array([0.2126, 0.7152, 0.0722])
    assert (np.diff(brightness) > 0).all(), "brighter is more, also in grey"
    assert (colours(np.array([3.0, 13.0]), 0, 1, "names")[0] == colours(np.array([3.0]), 0, 1, "names")[0]).all()
    assert (colours(np.zeros(3), 2, 2) == colours(np.zeros(3), 2, 3)).all()
    with pytest.raises(ValueError, match="palette"):
        colours(values, 0, 1, "grue")


def test_each_pixel_shows_its_texel() -> None:
    """Straight at a wall: rows of texels one by one; the sphere, which has none, is grey; outside is the background."""
    scene = scene_of(
        [quad("wall", [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]), ball("m", (0, 0, 0.5), 0.2, 1, MIRROR)]
    )
    frame = seen_from(scene, (0, 0, 4), (0, 0, 0), tan=0.3, size=64)
    maps = frame.surfaces.lightmaps
    texel = nearest_texels(maps, frame.gbuffer)
    wall = frame.gbuffer["object"] == 0
    assert wall.sum() > 1000
    own = maps.texels[texel[wall]]
    size = scene.texel_size
    pixel = frame.gbuffer[wall]
    corner = scene.corners[pixel["primitive"]]
    u, v = pixel["u"][:, None], pixel["v"][:, None]
    place = corner[:, 0] * (1 - u - v) + corner[:, 1] * u + corner[:, 2] * v
    assert np.abs(own["position"] - place).max() <= size * 0.55
    assert (own["state"] == VALID).all()

    quantity = np.arange(len(maps.texels), dtype=np.float64)
    image = preview(maps, frame.gbuffer, quantity, 0, len(quantity))
    assert image.shape == (64, 64, 3)
    assert image.dtype == np.uint8
    assert (image[frame.gbuffer["primitive"] < 0] == BACKGROUND).all()
    mirror = image[frame.gbuffer["object"] == 1].astype(int)
    spread = np.abs(np.diff(np.array(NO_TEXEL)))
    assert np.abs(np.diff(mirror, axis=1)).max() <= spread.max() + 1, "grey"
    plain = preview_colours(maps, frame.gbuffer, np.full((len(quantity), 3), 200, dtype=np.uint8))
    inner = wall & (np.roll(wall, -1, 0) & np.roll(wall, -1, 1))
    assert len(np.unique(plain[inner], axis=0)) == 1, "a flat wall of one colour is even"
    chess = preview_colours(maps, frame.gbuffer, np.full((len(quantity), 3), 200, dtype=np.uint8), grid=True)
    assert len(np.unique(chess[inner], axis=0)) == 2


def test_geometry_reads_and_backs_show_no_texel() -> None:
    scene = scene_of(room())
    frame = seen_from(scene, (0, 0, 0.9), (0, 0, -1))
    white = np.full((len(frame.surfaces.lightmaps.texels), 3), 255, dtype=np.uint8)
    image = preview_colours(frame.surfaces.lightmaps, frame.gbuffer, white)
    names = scene.object_names
    shades = [np.median(image[frame.gbuffer["object"] == names.index(n)]) for n in ("bottom", "left", "far", "right")]
    assert len(set(shades)) == 4, "walls that face different ways differ"
    outside = seen_from(scene, (3, 2, 4), (0, 0, 0))
    assert (nearest_texels(outside.surfaces.lightmaps, outside.gbuffer)[~outside.gbuffer["front"]] == -1).all()


def test_the_maps_as_a_picture() -> None:
    scene = scene_of(room())
    maps = seen_from(scene, (0, 0, 0.9), (0, 0, -1)).surfaces.lightmaps
    image = map_view(maps, np.ones(len(maps.texels)), 0, 1, "inferno", pixels=2)
    assert image.shape[0] % 2 == image.shape[1] % 2 == 0
    top = colours(np.ones(1), 0, 1, "inferno")[0]
    assert ((image == top).all(axis=-1).sum()) == 4 * (maps.texels["state"] == VALID).sum()
    assert (image == np.array(BACKGROUND, dtype=np.uint8)).all(axis=-1).any()
