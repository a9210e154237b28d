# amaranth: UnusedElaboratable=no
# (units are also made only to see whether they can be)
"""What the parameters of the hardware may be: everything else is refused, and at all ends the hardware is right."""

from collections.abc import Iterator, Mapping
from copy import deepcopy
from functools import cache
from itertools import combinations
from typing import Any

import numpy as np
import pytest

from lightloom.gen.verilog import verilog_of
from lightloom.golden_model.contract import bitpack
from lightloom.golden_model.contract.formats import TRIANGLE
from lightloom.golden_model.host.errors import InputError
from lightloom.golden_model.host.parameters import Parameter, powers_of_two
from lightloom.golden_model.stimuli.ray_families import adversarial_rays, diffuse_rays
from lightloom.golden_model.tracing.wide_bvh.encode import build_wide
from lightloom.golden_model.tracing.wide_bvh.traversal import queries_of, trace_tree
from lightloom.rtl.catalogue import CATALOGUE
from lightloom.rtl.config import PARAMETERS, PRESETS, Config
from lightloom.rtl.intersection.box_axis import STEPS
from lightloom.rtl.intersection.determinant import DIGITS
from lightloom.sim.traversal import TraversalUnit

SEED = 1905
RAYS, TRIANGLES = 800, 200
TRACED = 20
"""Members of the covering array that rays are traced through."""
MOST_UNITS = 2
"""Of a member that rays are traced through: more are more copies of the same, and take too long to build."""

Row = dict[str, int]


def config_of(fields: Mapping[str, Any]) -> Config:
    return Config.of(**fields)


def refused(name: str, value: object) -> str:
    """The message with which `value` is refused."""
    with pytest.raises(InputError) as error:
        config_of({name: value})
    message = str(error.value)
    assert "\n" not in message
    assert message == f"{name} {value!r}: must be {PARAMETERS[name].allowed}"
    return message


@pytest.mark.parametrize("each", PARAMETERS.values(), ids=PARAMETERS)
def test_what_is_below_or_above_a_range_is_refused(each: Parameter) -> None:
    if each.name == "multiplier_blocks":  # truth values have no number below or above
        outside: list[object] = [-1, 2, 0, 1, None]
    else:
        outside = [each.values[0] - 1, each.values[-1] + 1, True, float(each.default), str(each.default), None]
    for value in outside:
        refused(each.name, value)
    for value in (each.values[0], each.values[-1]):
        assert config_of({each.name: value}).flat()[each.name] == value
        assert each.parsed(str(value)) == value
    with pytest.raises(InputError, match=f"^{each.name} many: must be "):
        each.parsed("many")


def test_a_block_is_of_its_kind() -> None:
    """A whole configuration, and with it everything that is derived from it, has the blocks that it says."""
    wrong: list[dict[str, Any]] = [{"streams": 5}, {"streams": PRESETS["base"].operators}, {"node_cache": None}]
    for blocks in wrong:
        (name,) = blocks
        with pytest.raises(InputError, match=f"^{name}: must be a "):
            Config(**blocks)


@pytest.mark.parametrize(
    ("name", "value", "allowed"),
    [
        ("contexts", 12, "a power of two, 2 to 256"),
        ("stack", 0, "4 to 64"),
        ("overlap", 9, "1 to 7"),
        ("node_ways", 17, "1 to 16"),
        ("node_sets", 48, "a power of two, 2 to 1024"),
        ("address_width", 7, "32 to 64"),
        ("tag_width", 0, "1 to 32"),
        ("units", 99, "1 to 16"),
        ("triangle_interval", 3, "1 or 2"),
        ("reciprocal_depth", 6, "0, 2, 3, 5, 7 or 13"),
        ("axi_width", 96, "a power of two, 32 to 512"),
        ("width", 6, "4 or 8"),
    ],
)
def test_what_once_gave_wrong_hardware(name: str, value: int, allowed: str) -> None:
    assert refused(name, value) == f"{name} {value}: must be {allowed}"


def unchecked(config: Config, name: str, value: int) -> Config:
    """The configuration with a value that no block would take."""
    changed = deepcopy(config)
    object.__setattr__(changed.operators, name, value)
    return changed


def test_depths_end_where_the_operators_do() -> None:
    """With a stage more than `Config` allows, an operator has no place for it."""
    for name, unit in [
        ("add_depth", "float_add"),
        ("multiply_depth", "float_multiply"),
        ("difference_of_products_depth", "float_difference_of_products"),
        ("divide_depth", "float_divide"),
        ("sqrt_depth", "float_sqrt"),
        ("compare_depth", "float_compare"),
        ("compare_depth", "float_minmax"),
        ("convert_depth", "float_to_half"),
    ]:
        depths = PARAMETERS[name].values
        assert depths[0] == 0
        made: list[Any] = [CATALOGUE[unit](config_of({name: depth})) for depth in depths]
        assert [core.latency for core in made] == list(depths)
        beyond = unchecked(Config(), name, depths[-1] + 1)
        with pytest.raises(ValueError, match=f"{unit}: depth must be 0 to {depths[-1]}, not {depths[-1] + 1}"):
            CATALOGUE[unit](beyond)
    assert PARAMETERS["node_test_depth"].values == range(STEPS + 1)
    divisors = [cycles for cycles in range(1, DIGITS + 1) if DIGITS % cycles == 0 and (cycles == 1 or cycles % 2 == 0)]
    assert PARAMETERS["reciprocal_depth"].values == (0, *(cycles + 1 for cycles in divisors))


def test_powers_of_two() -> None:
    assert powers_of_two(2, 16) == (2, 4, 8, 16)


# --- a covering array: of any two fields, all pairs of least, default and greatest ----------------------------------


def levels(each: Parameter) -> list[int]:
    return sorted({each.values[0], each.default, each.values[-1]})


def pairs_of(row: Row) -> Iterator[tuple[tuple[str, int], tuple[str, int]]]:
    yield from combinations(row.items(), 2)


@cache
def covering_array() -> list[Config]:
    """Greedy: each row begins with a pair that is missing, each field in turn takes what covers most missing pairs."""
    choices = {name: levels(each) for name, each in PARAMETERS.items()}
    missing = {
        ((one, x), (other, y)): None
        for one, other in combinations(choices, 2)
        for x in choices[one]
        for y in choices[other]
    }
    rows: list[Row] = []
    while missing:
        row = dict(next(iter(missing)))
        for name, values in choices.items():
            if name not in row:
                partners = list(row.items())

                def gain(value: int, name: str = name, partners: list[tuple[str, int]] = partners) -> int:
                    here = (name, value)
                    return sum((here, other) in missing or (other, here) in missing for other in partners)

                turned = values[len(rows) % len(values) :] + values[: len(rows) % len(values)]
                row[name] = max(turned, key=gain)
        rows.append({name: row[name] for name in choices})
        for pair in pairs_of(rows[-1]):
            missing.pop(pair, None)
    return [config_of(row) for row in rows]


def test_the_array_covers_all_pairs_of_ends() -> None:
    covered = {pair for config in covering_array() for pair in pairs_of(config.flat())}
    for one, other in combinations(PARAMETERS.values(), 2):
        for x in (one.values[0], one.values[-1]):
            for y in (other.values[0], other.values[-1]):
                assert ((one.name, x), (other.name, y)) in covered
    assert len(covering_array()) >= TRACED


@pytest.mark.long
@pytest.mark.parametrize("number", range(len(covering_array())))
def test_every_member_elaborates(number: int) -> None:
    config = covering_array()[number]
    assert "module traversal(" in verilog_of("traversal", config)


@cache
def scene() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Triangles in a cube, their masks, and RAY_QUERY (RAYS,) of every kind."""
    rng = np.random.default_rng(SEED)
    triangles = np.zeros(TRIANGLES, TRIANGLE)
    centre = rng.random((TRIANGLES, 3), np.float32)
    for name in ("v0", "v1", "v2"):
        triangles[name] = centre + rng.normal(scale=0.07, size=(TRIANGLES, 3)).astype(np.float32)
    # Few of those that meet every box: with two tags, rays are traced nearly one by one.
    rays = np.concatenate(
        [diffuse_rays(triangles, RAYS - RAYS // 8, SEED), adversarial_rays(triangles, RAYS // 8, SEED)]
    )
    queries = queries_of(
        rays,
        any_hit=rng.random(RAYS) < 0.3,
        cull=rng.random(RAYS) < 0.3,
        mask=rng.choice(np.array([0xFF, 0x10]), RAYS),
    )
    return triangles, rng.choice(np.array([0xFF, 0x0F, 0x30], np.uint8), TRIANGLES), queries


@pytest.mark.long
@pytest.mark.parametrize("number", range(TRACED))
def test_a_member_traces_as_the_model(number: int) -> None:
    member = covering_array()[number]
    config = member.but(units=min(member.traversal.units, MOST_UNITS))
    triangles, masks, queries = scene()
    tree = build_wide(triangles, width=config.tree.width, max_levels=config.traversal.stack, masks=masks)
    wanted, _ = trace_tree(tree.blocks, queries, width=config.tree.width, stack=config.traversal.stack)
    unit = TraversalUnit(config, memory_bits=18, level=0)
    run = unit.run(
        tree.blocks,
        queries,
        latency=8,
        reorder=100,
        interleave=True,
        memory_stall=64,
        stall_seed=SEED,
        seed=SEED,
    )
    wrong = np.flatnonzero(~bitpack.equal(wanted, run.results))
    assert not len(wrong), (
        f"seed {SEED}, {config}: {len(wrong)} rays, the first is {wrong[0]}: {queries[wrong[0]]}: "
        f"{run.results[wrong[0]]}, not {wanted[wrong[0]]}"
    )
