"""Faults in what is between a unit and its registers: the front, the block of registers, the end of an abort."""

from lightloom.gen.formal.mutations import Mutation

FRONT, BLOCK, FIELDS = (f"rtl/registers/{name}.py" for name in ("front", "register_block", "unit_fields"))
PORT, ABORTS = "rtl/registers/axi_lite.py", "rtl/memory/aborts.py"
PROTOCOL, CONTENTS = ("register_block/protocol",), ("register_block/contents",)


def _bench(part: str) -> tuple[str, ...]:
    """A part of the bench of the traversal unit behind registers."""
    return (f"tests/verif/test_front.py::test_front[{part}-verilator]",)


def _fault(file: str, checks: tuple[str, ...], name: str, old: str, new: str, what: str) -> Mutation:
    return Mutation(name=name, file=file, old=old, new=new, what=what, checks=checks)


FAULTS = (
    _fault(
        FRONT,
        _bench("registers"),
        "front-event-of-a-reset",
        "before = Signal(init=1,",
        "before = Signal(init=0,",
        "an abort is over when none has been",
    ),
    _fault(
        FRONT,
        _bench("events"),
        "front-event-once",
        "before.eq(level)",
        "before.eq(before | level)",
        "an event happens only the first time",
    ),
    _fault(
        FRONT,
        _bench("events"),
        "front-interrupt-of-results",
        "names = (RESULT_CAME, *(event.name for event in self._unit.EVENTS))",
        "names = (RESULT_CAME,)",
        "the interrupt does not know the unit's events",
    ),
    _fault(
        FRONT,
        _bench("events"),
        "front-interrupt-without-mask",
        'getattr(block, name) & getattr(block, f"{name}_enable")',
        "getattr(block, name)",
        "events that are not enabled raise the interrupt",
    ),
    _fault(
        FRONT,
        _bench("rays"),
        "front-event-of-the-stream",
        "came.eq(results.i.valid & results.i.ready)",
        "came.eq(unit.o.valid & unit.o.ready)",
        "a result of the stream is an event of software",
    ),
    _fault(
        FRONT,
        _bench("rays"),
        "front-wait-not-told",
        "block.operands_wait.eq(waits)",
        "block.operands_wait.eq(mine)",
        "operands behind those of the stream are not held",
    ),
    _fault(
        FRONT,
        _bench("rays"),
        "front-stream-loses",
        "self.i.ready.eq(unit.i.ready & ~mine)",
        "self.i.ready.eq(unit.i.ready)",
        "operands of the stream are lost while those of software are taken",
    ),
    _fault(
        FRONT,
        _bench("rays"),
        "front-halves-swapped",
        "else halves(name))",
        "else halves(name)[::-1])",
        "the upper half of a wide control is its lower one",
    ),
    _fault(
        FRONT,
        _bench("aborts"),
        "front-operands-outlive-an-abort",
        "with m.If(unit.forgetting | (mine & unit.i.ready)):",
        "with m.If(mine & unit.i.ready):",
        "what waits to be taken goes on behind an abort",
    ),
    _fault(
        FRONT,
        _bench("aborts"),
        "front-results-outlive-an-abort",
        "ResetInserter(unit.forgetting)(results)",
        "results",
        "what waits in the registers of the result is there behind an abort",
    ),
    _fault(
        FIELDS,
        _bench("rays"),
        "front-nothing-is-held",
        "(Access.RW, WAITS) if operand",
        '(Access.RW, "") if operand',
        "operands that wait are overwritten",
    ),
    _fault(
        BLOCK,
        PROTOCOL,
        "registers-read-withdrawn",
        "with m.If(port.rready):",
        "with m.If(1):",
        "the answer to a read is taken back",
    ),
    _fault(
        BLOCK,
        CONTENTS,
        "registers-data-overwritten",
        "with m.If(port.wvalid & ~given):",
        "with m.If(port.wvalid):",
        "data that wait for their address are replaced by the next",
    ),
    _fault(
        BLOCK,
        CONTENTS,
        "registers-address-overwritten",
        "with m.If(port.awvalid & ~addressed):",
        "with m.If(port.awvalid):",
        "an address that waits for its data is replaced by the next",
    ),
    _fault(
        BLOCK,
        CONTENTS,
        "registers-half-of-any-read",
        "if register.width > DATA_BITS:\n                        with m.If(done):",
        "if register.width >= DATA_BITS:\n                        with m.If(done):",
        "a read of 32 bits forgets the upper half that was kept",
    ),
    _fault(
        PORT,
        CONTENTS,
        "registers-decode-error",
        "= 0b00, 0b10",
        "= 0b00, 0b11",
        "what is refused is answered otherwise",
    ),
    _fault(
        ABORTS,
        ("axi_read_arbiter/abort",),
        "abort-lost-at-the-end-of-one",
        "unit.aborting.eq(unit.abort | (unit.aborting & ~over))",
        "unit.aborting.eq(Mux(unit.aborting, ~over, unit.abort))",
        "an abort in the last cycle of an abort is none",
    ),
)
