"""Faults in the sharing of the port for reads, its aborts, and in what reads the header."""

from lightloom.gen.formal.mutations import Mutation

TIMER, ARBITER, ABORTS, HEADER = (
    f"rtl/memory/{name}.py" for name in ("read_timer", "axi_read_arbiter", "aborts", "header_reader")
)

FAULTS = (
    Mutation(
        name="timer-passes-a-shorter-time",
        file=TIMER,
        old="elapsed >= self.timeout",
        new="elapsed == self.timeout",
        what="a timeout that is made shorter than the time that has passed is never noticed",
        checks=("tests/rtl/test_axi_read_arbiter.py::test_a_timeout_that_is_made_shorter",),
    ),
    Mutation(
        name="abort-lets-addresses-out",
        file=ARBITER,
        old="(self.abort | self.aborting) & (~port.arvalid | port.arready)",
        new="self.aborting & (~port.arvalid | port.arready)",
        what="an address is offered in the cycle after an abort",
        checks=("axi_read_arbiter/abort",),
    ),
    Mutation(
        name="abort-ends-too-early",
        file=ARBITER,
        old="port.arvalid | asked | (left != 0)",
        new="port.arvalid | (left != 0)",
        what="an abort is over in the cycle after the last address was taken",
        checks=("axi_read_arbiter/abort",),
    ),
    Mutation(
        name="silence-with-an-address",
        file=ARBITER,
        old="(port.arvalid, port.rvalid)",
        new="(port.rvalid,)",
        what="an abort ends while the memory takes no address",
        checks=("axi_read_arbiter/timed-abort",),
    ),
    Mutation(
        name="missing-beats-stay",
        file=ARBITER,
        old="            m.d.sync += left.eq(0)",
        new="            m.d.sync += left.eq(left)",
        what="beats that never came are waited for at the next abort",
        checks=("axi_read_arbiter/timed-abort", "tests/rtl/test_axi_read_arbiter.py"),
    ),
    Mutation(
        name="surplus-below-zero",
        file=ARBITER,
        old="(came & (left != 0))",
        new="came",
        what="a beat that nobody asked for makes the next abort wait for ever",
        checks=("tests/rtl/test_axi_read_arbiter.py",),
    ),
    Mutation(
        name="read-arbiter-counts-one-too-few",
        file=ARBITER,
        old="range(self.reads * axi.block_beats + 1)",
        new="range(self.reads * axi.block_beats)",
        what="an abort with all beats to come that may be is over at once",
        checks=("axi_read_arbiter/abort",),
    ),
    Mutation(
        name="abort-counts-with-a-clock",
        file=ABORTS,
        old="over.eq(Mux(unit.timed, unit.tick & silence & silent, ~awaited))",
        new="over.eq((unit.timed & unit.tick & silence & silent) | ~awaited)",
        what="surplus beats end an abort before all reads are over",
        checks=("axi_read_arbiter/timed-abort", "tests/verif/test_traversal.py::test_aborts_of_an_array"),
    ),
    Mutation(
        name="abort-without-a-clock",
        file=ABORTS,
        old="Mux(unit.timed, unit.tick",
        new="Mux(0, unit.tick",
        what="an abort waits for ever for beats that never come",
        checks=("axi_read_arbiter/timed-abort", "tests/verif/test_traversal.py::test_aborts_of_an_array"),
    ),
    Mutation(
        name="abort-ends-at-the-first-tick",
        file=ABORTS,
        old="unit.tick & silence & silent",
        new="unit.tick & silent",
        what="an abort is over at the first tick",
        checks=("axi_read_arbiter/timed-abort",),
    ),
    Mutation(
        name="silence-while-held",
        file=ABORTS,
        old="any_of((unit.abort, *stirs))",
        new="any_of(stirs)",
        what="the time in which an address waits at an array's port counts as silence",
        checks=("axi_read_arbiter/timed-abort", "tests/verif/test_traversal.py::test_aborts_of_an_array"),
    ),
    Mutation(
        name="header-taken-late",
        file=HEADER,
        old="with m.If(reading | self.base[:OFFSET_BITS].any()):",
        new="with m.If(self.base[:OFFSET_BITS].any()):",
        what="the beats of a header that was given up are taken for the next one's",
        checks=("tests/rtl/test_header_reader.py",),
    ),
    Mutation(
        name="header-of-any-id",
        file=HEADER,
        old="self.m_axi.rvalid & (self.m_axi.rid == 0)",
        new="self.m_axi.rvalid",
        what="beats of other reads are taken for the header's",
        checks=("tests/rtl/test_header_reader.py::test_beats_of_other_ids_are_no_part_of_the_header",),
    ),
    Mutation(
        name="header-address-changes",
        file=HEADER,
        old="                with m.If(reading | self.base[:OFFSET_BITS].any()):",
        new="                m.d.sync += self.tree_base.eq(self.base)\n"
        "                with m.If(reading | self.base[:OFFSET_BITS].any()):",
        what="a load changes the address of a header that was given up, while that is offered",
        checks=("tests/rtl/test_header_reader.py::test_a_late_header",),
    ),
    Mutation(
        name="header-before-its-address",
        file=HEADER,
        old="beat.eq(reading & ~asks & self.m_axi.rvalid",
        new="beat.eq(reading & self.m_axi.rvalid",
        what="beats that come before the address is taken are taken for the header's",
        checks=("tests/rtl/test_header_reader.py::test_beats_before_the_address_is_taken_are_no_part_of_the_header",),
    ),
    Mutation(
        name="header-given-up-when-whole",
        file=HEADER,
        old="m.Elif(self.tick & waited)",
        new="m.If(self.tick & waited)",
        what="a header whose last beat comes at the second tick is given up",
        checks=("tests/rtl/test_header_reader.py::test_a_header_that_is_whole_at_the_second_tick",),
    ),
)
