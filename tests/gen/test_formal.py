"""The quick proofs; and that benches, references and faults do what they are for."""

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from amaranth import Module, Signal
from amaranth.lib import stream, wiring
from amaranth.lib.wiring import In, Out

from lightloom.gen.formal.all_inputs import Gates
from lightloom.gen.formal.bench import Bench
from lightloom.gen.formal.catalogue import PROPERTIES
from lightloom.gen.formal.faults.catalogue import FAULTS
from lightloom.gen.formal.mutations import ROOT
from lightloom.gen.formal.numbers import every_input
from lightloom.gen.formal.properties import Bounded, Induction, Outcome, Property
from lightloom.gen.formal.small_floats import SmallFormat
from lightloom.gen.formal.solve import solve
from lightloom.gen.formal.streams import Tracker, held
from lightloom.rtl.fabric.float_format import FloatFormat
from lightloom.rtl.operators.float_multiply import FloatMultiply


def documented() -> dict[str, tuple[str, dict[str, int]]]:
    """The table of docs/proofs.md by property: the method, and the cycle in which each cover is reached."""
    text = (ROOT / "docs" / "proofs.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| `(\S+/\S+)` \| ([^|]+) \| ([^|]+) \|", text, re.MULTILINE)
    return {
        key: (method, {name: int(cycle) for name, cycle in (one.split() for one in reached.split(", "))})
        for key, method, reached in rows
    }


REACHED = documented()


def prove(one: Property, folder: Path, solver: str = "yices") -> Outcome:
    return solve([one], [solver], folder / "proofs", jobs=1)[0]


def check_property(key: str, folder: Path) -> None:
    outcome = prove(PROPERTIES[key], folder)
    assert outcome.status == "proved", outcome.as_row()
    if key in REACHED:
        assert outcome.reached == REACHED[key][1], "docs/proofs.md says when other covers are reached"


@pytest.mark.parametrize("key", [key for key, one in PROPERTIES.items() if one.quick])
def test_property_holds(key: str, tmp_path: Path) -> None:
    check_property(key, tmp_path)


@pytest.mark.parametrize(("key", "cycles"), [("control/life-of-a-ray", 11)])
def test_property_holds_and_what_is_reached_soon_is(key: str, cycles: int, tmp_path: Path) -> None:
    """Of a proof most of whose time goes into covers that are reached late: the whole of it is a long test."""
    outcome = prove(replace(PROPERTIES[key], reach=cycles), tmp_path)
    wanted = {name: cycle for name, cycle in REACHED[key][1].items() if cycle <= cycles}
    assert len(wanted) >= 4
    assert outcome.reached == wanted, outcome.as_row()
    # Covers are looked for when all that is required was proved.
    late = set(REACHED[key][1]) - set(wanted)
    assert outcome.status == "vacuous"
    assert set(outcome.note.removeprefix(f"not reached within {cycles} cycles: ").split(", ")) == late


@pytest.mark.long
@pytest.mark.parametrize("key", [key for key, one in PROPERTIES.items() if not one.quick])
def test_every_property_holds(key: str, tmp_path: Path) -> None:
    check_property(key, tmp_path)


def test_every_bounded_proof_has_covers_that_the_docs_list() -> None:
    bounded = {key for key, one in PROPERTIES.items() if isinstance(one.method, Bounded)}
    assert bounded <= set(REACHED)
    for key, (method, reached) in REACHED.items():
        one = PROPERTIES[key]
        assert method == str(one.method), key
        assert reached, key
        assert set(reached) == set(one.covers), key
        assert all(0 < cycle <= one.reach_within for cycle in reached.values()), key


class Register(wiring.Component):
    """A stream through one register, which is wrong where it is told to be."""

    def __init__(self, *, overwrites: bool):
        self.overwrites = overwrites
        super().__init__({"i": In(stream.Signature(4)), "o": Out(stream.Signature(4))})

    def elaborate(self, platform: object) -> Module:
        m = Module()
        m.d.comb += self.i.ready.eq(1 if self.overwrites else ~self.o.valid | self.o.ready)
        with m.If(self.i.ready):
            m.d.sync += [self.o.valid.eq(self.i.valid), self.o.payload.eq(self.i.payload)]
        return m


def register_bench(*, overwrites: bool, blocked: bool = False, late: int = 0) -> Bench:
    """`late`: something is to be reached that takes that many cycles."""
    component = Register(overwrites=overwrites)
    bench = Bench(component)
    i, o = component.i, component.o
    held(bench, "o", o.valid, o.ready, o.payload)
    leaves = o.valid & o.ready
    enters = i.valid & i.ready
    tracker = Tracker(
        bench, most=1, enters=enters, incoming=i.payload, leaves=leaves, offers=o.valid, outgoing=o.payload
    )
    bench.require("count_is_valid", tracker.count == o.valid)
    if blocked:
        bench.assume(~i.valid)
    if late:
        age = Signal(range(late + 2))
        bench.m.d.sync += age.eq(age + (age != late))
        bench.reach("late", age == late)
    return bench


def register_property(method: Induction | Bounded, **options: Any) -> Property:
    return Property(
        unit="register",
        name="stream",
        says="a register",
        method=method,
        build=lambda: register_bench(**options),
        reach=0 if isinstance(method, Bounded) else 4,
    )


@pytest.mark.parametrize("solver", ["yices", "z3"])
def test_a_sound_component_is_proved(solver: str, tmp_path: Path) -> None:
    outcome = prove(register_property(Induction(depth=1), overwrites=False), tmp_path, solver)
    assert outcome.status == "proved"
    assert list((tmp_path / "proofs").iterdir()) == []  # nothing is left of what holds


@pytest.mark.parametrize("method", [Induction(depth=1), Bounded(depth=5)], ids=["induction", "bounded"])
def test_a_fault_gives_a_counterexample(method: Induction | Bounded, tmp_path: Path) -> None:
    outcome = prove(register_property(method, overwrites=True), tmp_path)
    assert outcome.status == "failed"
    assert outcome.note  # names what does not hold
    assert set(outcome.note.split(", ")) <= {"o_payload_holds", "o_valid_holds", "room", "unchanged", "count_is_valid"}
    assert (tmp_path / "proofs" / outcome.trace).read_text().startswith("$")


def test_assumptions_that_leave_nothing_are_found(tmp_path: Path) -> None:
    outcome = prove(register_property(Induction(depth=1), overwrites=False, blocked=True), tmp_path)
    assert outcome.status == "vacuous"
    assert outcome.note == "not reached within 4 cycles: followed_one_leaves, full"


@pytest.mark.parametrize(
    ("late", "status", "note"), [(4, "proved", ""), (5, "vacuous", "not reached within 5 cycles: late")]
)
def test_what_is_reached_beyond_the_bound_is_not_reached(late: int, status: str, note: str, tmp_path: Path) -> None:
    """The count begins in the cycle after the reset, and is there a cycle later."""
    outcome = prove(register_property(Bounded(depth=5), overwrites=False, late=late), tmp_path)
    assert (outcome.status, outcome.note) == (status, note)
    assert outcome.reached == {"full": 2, "followed_one_leaves": 2} | ({"late": 5} if late == 4 else {})


def test_a_bounded_proof_reaches_within_its_bound_and_has_covers() -> None:
    with pytest.raises(ValueError, match="it has to reach within its bound"):
        Property(unit="register", name="stream", says="", method=Bounded(depth=5), build=Bench, reach=6)
    with pytest.raises(ValueError, match="register/stream: 0 covers to be reached in 5 cycles"):
        Property(unit="register", name="stream", says="", method=Bounded(depth=5), build=Bench).bench()
    with pytest.raises(ValueError, match="register/stream: 2 covers to be reached in 0 cycles"):
        replace(register_property(Induction(), overwrites=False), reach=0).bench()


def test_reference_of_small_formats_is_ieee() -> None:
    """NumPy's binary16, whose operations round once, on random operands, with its subnormal numbers flushed."""
    seed = 20
    number = SmallFormat(5, 10)
    bits = np.random.default_rng(seed).integers(0, 1 << 16, (2, 2000), dtype=np.uint16)

    def flushed(values: np.ndarray) -> np.ndarray:
        return np.where(np.abs(values) < 2.0**-14, np.copysign(0, values), values)

    a, b = flushed(bits.view(np.float16).astype(np.float64))
    with np.errstate(all="ignore"):
        exact = {"add": a - b, "multiply": a * b, "divide": a / b, "sqrt": np.sqrt(a)}
        rounded = {name: flushed(values.astype(np.float16)).astype(np.float16) for name, values in exact.items()}
    found = {
        "add": [number.add(int(x), int(y), 1) for x, y in bits.T],
        "multiply": [number.multiply(int(x), int(y)) for x, y in bits.T],
        "divide": [number.divide(int(x), int(y)) for x, y in bits.T],
        "sqrt": [number.sqrt(int(x)) for x in bits[0]],
    }
    for name, values in rounded.items():
        expected = np.where(np.isnan(values), np.uint16(number.nan), values.view(np.uint16))
        wrong = np.flatnonzero(expected != np.array(found[name]))
        assert not len(wrong), f"seed {seed}, {name} of {bits[:, wrong[0]]}"


def test_reference_of_the_difference_of_products_rounds_once() -> None:
    number = SmallFormat(4, 3)
    near_one, one = 0b0111001, 0b0111000  # 1.125, 1
    assert number.take(near_one)[1] == 1.125
    # 1.125**2 - 1 = 0.265625, which is halfway between two numbers; 1.125**2 alone would round to 1.25.
    assert number.take(number.difference_of_products(near_one, near_one, one, one))[1] in (0.25, 0.28125)
    assert number.difference_of_products(near_one, one, near_one, one) == 0


def test_all_inputs_are_tried() -> None:
    gates = Gates.of_core(FloatMultiply(0, FloatFormat(2, 2)))
    (operands, results) = next(iter(gates.run()))
    assert gates.inputs == {"a": 5, "b": 5}
    assert sorted(zip(operands["a"], operands["b"], strict=True)) == [(a, b) for a in range(32) for b in range(32)]
    number = SmallFormat(2, 2)
    assert [int(z) for z in results["z"]] == [
        number.multiply(int(a), int(b)) for a, b in zip(operands["a"], operands["b"], strict=True)
    ]


def test_a_wrong_result_is_told_with_its_operands() -> None:
    class Wrong(FloatMultiply):
        """One bit, for one value of one operand."""

        def elaborate(self, platform: object) -> Module:
            whole, inner = Module(), FloatMultiply(0, self.format)
            whole.submodules.inner = inner
            whole.d.comb += [inner.i.eq(self.i), self.o.z.eq(inner.o.z ^ (self.i.a == 3))]
            return whole

    assert every_input(Wrong, SmallFormat(2, 2)) == "a = 0x3, b = 0x0: z is 0x1, should be 0x0"


def test_faults_are_where_the_list_says() -> None:
    for one in FAULTS.values():
        text = (ROOT / one.file).read_text(encoding="utf-8")
        assert text.count(one.old) == 1, one.name
        assert one.new != one.old
        compile(text.replace(one.old, one.new), one.name, "exec")  # a fault is not a text that cannot be read
        assert one.checks, one.name
        for check in one.checks:
            assert check in PROPERTIES or (ROOT / check.split("::")[0]).exists(), f"{one.name}: {check}"
