"""Which maps and texels INFLUENCE reaches: what a scalar twin says, one record and one texel after the other."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from lightloom.golden_model.contract.formats import INFLUENCE, TEXEL, WHOLE_CHANGE
from lightloom.golden_model.driver.changes import table_of
from lightloom.golden_model.driver.report import loose_bounds
from lightloom.golden_model.engine.selection.influence.reach import texel_changes, touched
from lightloom.golden_model.engine.selection.policy import Policy
from lightloom.golden_model.scene.pose import scene_at
from lightloom.golden_model.tables.lightmap import VALID
from tests.golden_model.selection_scenes import visited

VOLUME, SHADOW, FOOTPRINT = range(3)
MAPS, TEXELS = 5, 60
Record = dict[str, Any]


def f(number: float) -> float:
    """Rounded to float32 and flushed: a sum or product of two numbers, which float64 holds."""
    rounded = np.float32(number)
    return float(rounded) if abs(rounded) >= np.finfo(np.float32).tiny else 0.0


def dot(a: list[float], b: list[float]) -> float:
    x, y, z = (f(p * q) for p, q in zip(a, b, strict=True))
    return f(f(x + y) + z)


def faces(centre: list[float], half: list[float], place: list[float], normal: list[float]) -> bool:
    away = [f(c - p) for c, p in zip(centre, place, strict=True)]
    return f(dot(normal, away) + dot([abs(n) for n in normal], half)) > 0


def between(r: Record, p: list[float]) -> bool:
    """Whether the box meets the segment from p to the light, by the six axes, all lengths doubled."""
    along = [f(light - x) for light, x in zip(r["light"], p, strict=True)]
    size = [f(b - a) for a, b in zip(r["low"], r["high"], strict=True)]
    middle = [f(f(r["light"][k] + p[k]) - f(r["low"][k] + r["high"][k])) for k in range(3)]
    if any(abs(middle[k]) > f(size[k] + abs(along[k])) for k in range(3)):
        return False
    for i, j in ((0, 1), (1, 2), (2, 0)):
        moment = abs(f(f(middle[i] * along[j]) - f(middle[j] * along[i])))
        if moment > f(f(size[i] * abs(along[j])) + f(size[j] * abs(along[i]))):
            return False
    return True


def level_of(r: Record, place: list[float], normal: list[float], owner: int) -> int:
    if r["kind"] == SHADOW:
        there = between(r, place) and faces(r["light"], r["light_half"], place, normal)
        return r["level"] if there else 0
    if r["kind"] == FOOTPRINT:
        away = [f(p - c) for p, c in zip(place, r["low"], strict=True)]
        return r["level"] if dot(away, away) <= f(r["reach_low"][0] ** 2) else 0
    level = 0
    for part in (1, 0.5, 0.25):
        inside = all(
            f(r["low"][k] - place[k]) <= f(r["reach_low"][k] * part)
            and f(place[k] - r["high"][k]) <= f(r["reach_high"][k] * part)
            for k in range(3)
        )
        level += inside
    level = min(level, r["level"])
    if r["facing"] and owner != r["object"]:
        half = [f(f(r["high"][k] - r["low"][k]) * 0.5) for k in range(3)]
        centre = [f(r["low"][k] + half[k]) for k in range(3)]
        level *= faces(centre, half, place, normal)
    return level


def map_touched(r: Record, low: list[float], high: list[float], number: int) -> bool:
    if any(a > b for a, b in zip(low, high, strict=True)) or r["surface"] not in (-1, number):
        return False
    if r["kind"] == SHADOW:
        low = [min(low[k], f(r["light"][k] - r["light_half"][k])) for k in range(3)]
        high = [max(high[k], f(r["light"][k] + r["light_half"][k])) for k in range(3)]
    return all(
        low[k] <= f(r["high"][k] + r["reach_high"][k]) and high[k] >= f(r["low"][k] - r["reach_low"][k])
        for k in range(3)
    )


def plain(record: np.ndarray) -> Record:
    return {name: record[name].tolist() for name in INFLUENCE.names or ()}


def random_records(rng: np.random.Generator, count: int) -> np.ndarray:
    """Of all kinds, in a cube of side 2; some lie or end just where texels and maps do."""
    records = np.zeros(count, dtype=INFLUENCE)
    records["kind"], records["facing"] = rng.integers(0, 3, count), rng.integers(0, 2, count)
    records["level"], records["octaves"] = rng.integers(1, 4, count), rng.integers(0, 8, count)
    records["object"], records["surface"] = rng.integers(-1, MAPS, count), np.maximum(rng.integers(-9, MAPS, count), -1)
    step = 8
    records["low"] = rng.integers(-step, step, (count, 3)) / step
    records["high"] = records["low"] + rng.integers(0, step // 2, (count, 3)) / step
    for name in ("reach_low", "reach_high"):
        records[name] = rng.integers(0, step, (count, 3)) / step
    records["light"] = rng.integers(-step, step + 1, (count, 3)) / step
    records["light_half"] = rng.integers(0, 3, (count, 3)) / step
    wild = rng.random(count) < 0.5
    for name in ("low", "high", "light"):
        records[name][wild] += rng.normal(0, 1e-3, (int(wild.sum()), 3)).astype(np.float32)
    return records


@pytest.mark.parametrize("seed", range(6))
def test_maps_and_texels_are_those_of_a_scalar_twin(seed: int) -> None:
    """Some maps are those of absent objects, whose box is inside out; some texels are not valid."""
    rng = np.random.default_rng(seed)
    records = random_records(rng, 150)
    boxes = np.sort(rng.integers(-8, 9, (MAPS, 2, 3)) / 8, axis=1).astype(np.float32)
    boxes[rng.integers(MAPS)] = [[np.inf] * 3, [-np.inf] * 3]
    texels = np.zeros(TEXELS, dtype=TEXEL)
    texels["position"] = rng.integers(-8, 9, (TEXELS, 3)) / 8
    texels["position"][::2] += rng.normal(0, 1e-3, (TEXELS // 2, 3)).astype(np.float32)
    normal = rng.normal(size=(TEXELS, 3))
    texels["normal"] = normal / np.linalg.norm(normal, axis=1)[:, None]
    texels["normal"][::3] = np.eye(3)[rng.integers(0, 3, 20)]
    texels["object"] = rng.integers(0, MAPS, TEXELS)
    texels["state"] = VALID
    valid = rng.random(TEXELS) < 0.8

    said = [plain(record) for record in records]
    around = list(enumerate(boxes.tolist()))
    wanted = [[map_touched(r, low, high, number) for number, (low, high) in around] for r in said]
    found = touched(records, boxes)
    assert found.tolist() == wanted, f"seed {seed}"
    assert 0.1 < found.mean() < 0.9

    levels = [0] * TEXELS
    changes = [0] * TEXELS
    for index, texel in enumerate(texels):
        owner = int(texel["object"])
        for r, reached in zip(said, wanted, strict=True):
            if valid[index] and reached[owner]:
                level = level_of(r, texel["position"].tolist(), texel["normal"].tolist(), owner)
                levels[index] = max(levels[index], level)
                if level:
                    changes[index] = max(changes[index], WHOLE_CHANGE - 2 * (3 - level) - r["octaves"])
    got = texel_changes(records, boxes, replace(visited().lightmaps, texels=texels), valid)
    assert got[0].tolist() == levels, f"seed {seed}"
    assert got[1].tolist() == changes, f"seed {seed}"


def test_absent_objects_have_no_box() -> None:
    stage = visited()
    guest = stage.scene.object_names.index("guest")
    for frame, there in ((0, True), (19, True), (20, False)):
        low, high = loose_bounds(table_of(stage.scene), scene_at(stage.scene, frame), Policy())[guest]
        assert (low <= high).all() == there
        assert there or (math.isinf(low[0]) and (low > high).all())
