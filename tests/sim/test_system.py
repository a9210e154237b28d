"""The harness of systems: units that it knows by their declarations, and what it says of those that break rules."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from lightloom.gen.watched import ports_of
from lightloom.golden_model.contract import bitpack
from lightloom.golden_model.contract.interfaces import PURE
from lightloom.golden_model.host.errors import InputError
from lightloom.golden_model.models import model_results
from lightloom.rtl.config import PRESETS
from lightloom.sim.emitted import emitted
from lightloom.sim.system import Content, Manner, Place, RunError, Shape, System, strobe, until
from lightloom.verif.vectors.unit_vectors import unit_vectors

STAND_IN = Path(__file__).with_name("system_stand_in.v").read_text(encoding="utf-8")
NUMBER = np.dtype([("number", "<u4")])
SEED, COUNT, BASE = 71, 300, 4096
STEPS = (strobe("start"), until(["started"], "the unit hangs: it does not start"))


@cache
def stand_in(original: str = "", mutant: str = "") -> System:
    """The stand-in, with one piece of its Verilog replaced."""
    assert not original or STAND_IN.count(original) == 1
    text = STAND_IN.replace(original, mutant) if original else STAND_IN
    return System("stand_in", text, input=NUMBER, output=NUMBER, tag_width=4, memory_bits=16, level=0)


def numbers(count: int = COUNT) -> np.ndarray:
    out = np.zeros(count, dtype=NUMBER)
    out["number"] = np.random.default_rng(SEED).integers(0, 64, count)
    return out


def content() -> Content:
    """Blocks of random words, of which the first ones of each may be written."""
    image = np.random.default_rng(SEED).integers(0, 2**32, 64 * 16, dtype=np.uint32).tobytes()
    regions = [(BASE + 64 * k, BASE + 64 * k + 3) for k in range(64)]
    return Content(base=BASE, image=image, writable=regions, read_back=(BASE, BASE + 64 * 64 - 1))


@pytest.mark.parametrize(
    ("manner", "stall_seed"),
    [
        (Manner(latency=1), None),
        (Manner(latency=60, stall=64, reorder=100, interleave=1, seed=9), 17),
    ],
    ids=["at once", "stalled"],
)
def test_reads_and_writes(manner: Manner, stall_seed: int | None) -> None:
    """Each operand gets what the one before it left: results, what lies in the memory in the end, and all figures."""
    operands, add = numbers(), 5
    words = np.frombuffer(content().image, dtype=np.uint32).copy()
    wanted = np.zeros(COUNT, dtype=NUMBER)
    for k, number in enumerate(operands["number"]):
        wanted["number"][k] = words[16 * number]
        words[16 * number] = number + add
    controls = {"base": BASE, "add": add, "write": 1}
    run = stand_in().run(
        operands, controls=controls, steps=STEPS, manner=manner, content=content(), stall_seed=stall_seed
    )
    wrong = np.flatnonzero(run.results != wanted)
    assert not len(wrong), f"seed {SEED}: operand {wrong[0]}, {operands[wrong[0]]}: {run.results[wrong[0]]}"
    assert run.memory == words.tobytes()
    assert run.counters == {"done": COUNT}
    assert (run.statuses, run.most_in_flight) == ({"started": 1, "state": 0}, 2)  # one waits before the unit
    figures = {name: run.figures[name] for name in ("read_bursts", "read_beats", "write_bursts", "write_beats")}
    assert set(figures.values()) == {COUNT}
    assert 5 * COUNT < run.cycles < 300 * COUNT


def test_nothing_is_written_where_nothing_is_to_be() -> None:
    run = stand_in().run(numbers(), controls={"base": BASE}, steps=STEPS, content=content())
    assert run.memory == content().image
    assert run.figures["write_bursts"] == 0


@pytest.mark.parametrize(
    ("original", "mutant", "message"),
    [
        ("running <= 1", "running <= 0", "the unit hangs: it does not start"),
        ("if (m_axi_bvalid) now <= GIVE", "now <= ANSWERED", "the unit hangs: no operand, result"),
        ("{operand[35:32], found}", "{~operand[35:32], found}", "a result whose tag no operand has"),
        ("64'd15", "64'd31", "a rule of AXI is broken; axi_memory: the master wrote a byte that may not"),
        ("m_axi_arsize = 6", "m_axi_arsize = 7", "a rule of AXI is broken; ar_size"),
        ("m_axi_wlast = 1", "m_axi_wlast = 0", "a rule of AXI is broken; w_last"),
    ],
    ids=["steps", "hang", "tag", "map", "read", "write"],
)
def test_a_unit_that_breaks_the_rules_is_an_error(original: str, mutant: str, message: str) -> None:
    with pytest.raises(RunError, match=message):
        controls = {"base": BASE, "write": 1}
        stand_in(original, mutant).run(numbers(40), controls=controls, steps=STEPS, content=content())


def test_what_cannot_be_run_is_refused() -> None:
    with pytest.raises(InputError, match="4,096 bytes at 65,535 are more than the simulated memory holds, 65,536"):
        stand_in().run(numbers(), content=Content(base=65_535, image=bytes(4096)))
    with pytest.raises(TypeError, match="operands are of dtype"):
        stand_in().run(np.zeros(3, dtype=np.float32))
    with pytest.raises(ValueError, match="stall_seed"):
        stand_in().run(numbers(), stall_seed=0)


def test_a_unit_without_memory_or_ports() -> None:
    """Of the catalogue, by its declaration alone."""
    unit, config = PURE["float_add"], PRESETS["tiny"]
    text = emitted(unit.name, config)
    width = config.streams.tag_width
    system = System(unit.name, text, input=unit.input, output=unit.output, tag_width=width, level=0)
    operands = unit_vectors(unit.name, 500, SEED)
    run = system.run(operands, stall_seed=3)
    wrong = np.flatnonzero(~bitpack.equal(run.results, model_results(unit.name, operands, config.flat())))
    assert not len(wrong), f"seed {SEED}: {operands[wrong[0]]}: {run.results[wrong[0]]}"
    assert (run.counters, run.statuses, run.memory) == ({}, {}, b"")


def test_ports_have_places() -> None:
    shape = Shape.of(ports_of(STAND_IN, "stand_in"))
    assert shape.controls["memory.seed"] == Place(42, 32)
    assert shape.controls["start"] == Place(76 + 2 * 20, 1)
    assert shape.controls["write"] == Place(76 + 2 * 20 + 1 + 20 + 7, 1)
    assert shape.statuses == {"started": Place(0, 1), "state": Place(1, 3)}
    assert shape.counters == ["done"]
