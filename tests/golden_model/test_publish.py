"""Publishing: binary16, filling of what has not been sampled and of what never is."""

import numpy as np

from golden_model.formats import TEXEL, TEXEL_STATE
from golden_model.lightmap import VALID, Lightmaps
from golden_model.publish import publish, pull_push


def maps_of(sizes: list[tuple[int, int]]) -> Lightmaps:
    """Lightmaps of the given (width, height), all texels valid, no triangles."""
    width, height = (np.array(side, dtype=np.int32) for side in zip(*sizes, strict=True))
    count = width * height
    texels = np.zeros(int(count.sum()), dtype=TEXEL)
    texels["state"] = VALID
    texels["object"] = np.repeat(np.arange(len(sizes)), count)
    return Lightmaps(
        width=width,
        height=height,
        offset=(np.cumsum(count) - count).astype(np.int32),
        uv=np.zeros((0, 3, 2), dtype=np.float32),
        texels=texels,
        chart=texels["object"].copy(),
        fill=np.arange(len(texels), dtype=np.int32),
    )


def state_of(values: np.ndarray, count: np.ndarray | int = 1) -> np.ndarray:
    state = np.zeros(len(values), dtype=TEXEL_STATE)
    state["irradiance"], state["count"] = values, count
    return state


def test_sampled_texels_are_published_in_binary16() -> None:
    values = np.random.default_rng(0).uniform(0, 100, (20, 3)).astype(np.float32)
    out = publish(maps_of([(5, 4)]), state_of(values))["rgba"]
    assert (out[:, :3] == values.astype(np.float16)).all()
    assert (out[:, 3] == 1).all()


def test_what_is_too_bright_for_binary16_stays_finite() -> None:
    out = publish(maps_of([(1, 1)]), state_of(np.array([[1e6, 65504, 3e38]], dtype=np.float32)))["rgba"]
    assert (out[0, :3] == 65504).all()


def test_empty_and_buried_texels_repeat_their_fill() -> None:
    maps = maps_of([(3, 1), (2, 1)])
    maps.texels["state"][[1, 3, 4]] = [0, 2, 0]
    maps.fill[:] = [0, 2, 2, -1, -1]
    values = np.arange(15, dtype=np.float32).reshape(5, 3) + 1
    out = publish(maps, state_of(values, np.array([1, 0, 1, 0, 0])))["rgba"]
    assert (out[[0, 1, 2]] == out[[0, 2, 2]]).all()
    assert (out[1, :3] == values[2]).all()
    assert not out[3:].any()


def test_unsampled_texels_lie_between_their_neighbours_with_weight_zero() -> None:
    maps = maps_of([(9, 7), (4, 4)])
    rng = np.random.default_rng(1)
    values = rng.uniform(2, 3, (len(maps.texels), 3)).astype(np.float32)
    count = (rng.random(len(values)) < 0.2).astype(int)
    count[63:] = 0  # nothing of the second map is known
    values[count == 0] = 0
    out = publish(maps, state_of(values, count))["rgba"]
    assert (out[:63, :3] >= 2).all()
    assert (out[:63, :3] <= 3).all()
    assert (out[:, 3] == count).all()
    assert not out[63:].any()


def test_pull_push_keeps_what_is_known_and_a_constant() -> None:
    rng = np.random.default_rng(2)
    for height, width in ((1, 1), (1, 9), (16, 16), (13, 21)):
        known = rng.random((height, width)) < 0.1
        known[height // 2, width // 2] = True
        values = np.where(known[..., None], np.float32(5), np.float32(-99))
        assert (pull_push(values, known) == 5).all()
        values = rng.normal(size=(height, width, 2)).astype(np.float32)
        assert (pull_push(values, known)[known] == values[known]).all()
    assert not pull_push(values, np.zeros_like(known)).any()
