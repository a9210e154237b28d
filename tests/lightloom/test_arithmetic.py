"""Operations that are counted in the model: against the graphs of the hardware, by hand, and the page of them."""

from collections import Counter
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from lightloom.bench.counting import counted, counting
from lightloom.bench.operations import Work, work
from lightloom.bench.settled import Case, measure
from lightloom.golden_model.contract.interfaces import OPERATORS
from lightloom.golden_model.engine.publishing.smoothing import STEPS
from lightloom.golden_model.numerics import floats
from lightloom.hardware.integer_gates import gates
from lightloom.pages import arithmetic
from lightloom.rtl.blocks import Texel
from lightloom.rtl.catalogue import CATALOGUE
from lightloom.rtl.config import PRESETS
from lightloom.rtl.fabric.dataflow import Dataflow
from tests import ROOT

FLOATS = np.array([1.5, -2.0, 3.25], dtype=np.float32)
WHOLE = np.array([1, -2, 300])


@pytest.fixture(scope="module")
def found() -> Work:
    return work()


def test_the_page_is_up_to_date() -> None:
    page = (ROOT / "docs" / "arithmetic.md").read_text(encoding="utf-8")
    assert page == arithmetic.page(), "python -m lightloom.pages.arithmetic > docs/arithmetic.md"


def test_operations_are_counted_by_number_and_width() -> None:
    with counting() as tally:
        a, n = counted(FLOATS), counted(WHOLE)
        _ = a * a + np.float32(1) < np.sqrt(np.abs(a))
        _ = -a * np.float32(0.5)  # by a power of two
        _ = n * 6 + n, n << 3, n > 5, np.maximum(n, 0)
        _ = n << np.array([0, 1, 4])
    assert tally == {
        ("float_multiply",): 3,
        ("float_add",): 3,
        ("float_sqrt",): 3,
        ("float_compare",): 3,
        ("product", 2, 10): 3,
        ("sum", 13): 3,
        ("compare", 10): 3,
        ("larger", 10): 3,
        ("shift", 14, 3): 3,
    }
    with counting() as nothing:
        _ = FLOATS * FLOATS
    assert not nothing


@pytest.mark.parametrize("name", OPERATORS)
def test_a_units_twin_counts_as_the_unit(name: str) -> None:
    operands = {"float_difference_of_products": 4, "float_sqrt": 1}.get(name, 1 if "to" in name else 2)
    value: Any = WHOLE.astype(np.int32) if name.startswith("fixed") else FLOATS
    value = value.astype(np.float16) if name.startswith("half") else value
    with counting() as tally:
        twin: Any = getattr(floats, name)
        result = twin(*[counted(value)] * operands)
    assert tally == {(name,): 3}
    np.testing.assert_array_equal(result, getattr(floats, name)(*[value] * operands))


def test_float64_on_the_way_is_refused() -> None:
    with counting(), pytest.raises(AssertionError, match="float64"):
        _ = counted(FLOATS.astype(np.float64)) + 1.0


@pytest.mark.parametrize(
    ("unit", "stage", "place", "more"),
    [
        # The model multiplies by a power of two, …
        ("texel_project", "selection", 2, {"float_multiply": 1}),
        # … says four times by how much depths may differ, and compares with infinity, …
        ("texel_match", "selection", 3, {"float_multiply": 3, "float_compare": 4}),
        # … adds to nothing, and compares where the unit looks at a sign.
        ("texel_blend", "rays", 1, {"float_add": 2, "float_compare": 1}),
    ],
)
def test_counts_are_those_of_the_units_graphs(
    found: Work, monkeypatch: pytest.MonkeyPatch, unit: str, stage: str, place: int, more: dict[str, int]
) -> None:
    graph, apply = Counter[str](), Dataflow.apply

    def watched(flow: Dataflow, name: str, core: Any, *args: Any, **operands: Any) -> Any:
        graph[core.unit.name] += 1
        return apply(flow, name, core, *args, **operands)

    monkeypatch.setattr(Dataflow, "apply", watched)
    every = Texel(project_interval=1, match_interval=1, blend_interval=1)
    CATALOGUE[unit](replace(PRESETS["base"], texel=every))
    tally = found.stages[stage][place].tally
    model = Counter({name: round(tally.get((name,), 0)) for name in OPERATORS})
    for counts in (graph, model):  # a conversion of few bits may be that of many
        counts["fixed64_to_float"] += counts.pop("fixed_to_float", 0)
    assert model == graph + Counter(more)


def test_smoothing_has_eight_neighbours_of_three_colours(found: Work) -> None:
    passes = [step for step in found.stages["publishing"] if "pass" in step.name]
    assert len(passes) == len(STEPS)
    for step, texels in zip(passes, (12 * 12, 8 * 8), strict=True):
        products = sum(times for (name, *widths), times in step.tally.items() if name == "product" and max(widths) > 20)
        assert products == 8 * 3 * texels


@pytest.mark.parametrize("name", ["sum", "compare", "larger", "logarithm", "product", "shift", "divide"])
def test_gates_rise_with_the_width(name: str) -> None:
    more = (3,) if name in ("product", "shift", "divide") else ()
    assert 0 < gates((name, 20, *more)) < gates((name, 40, *more))


def test_a_frame_of_selection_is_measured() -> None:
    frame = measure(Case(texel=0.3, width=48, height=27, updates=200, frames=3, measured=2), backend="numpy")
    assert 0 < frame.rewritten <= min(frame.updates, frame.regions)
    assert 0 < frame.on_screen < frame.valid <= frame.texels
    assert 150 <= frame.updates <= 200  # eye rays take a share
    assert frame.coarser > 0
