"""Faults in what reads and writes share of a port, and in the checker of AXI's rules."""

from lightloom.gen.formal.mutations import Mutation

SHARING, FOLLOWING = (f"rtl/memory/{name}.py" for name in ("axi_sharing", "axi_following"))

FAULTS = (
    Mutation(
        name="address-to-all",
        file=SHARING,
        old='getattr(master, f"{channel}ready").eq(chosen[k] & addresses.i.ready)',
        new='getattr(master, f"{channel}ready").eq(addresses.i.ready)',
        what="an address is taken from every master",
        checks=("axi_read_arbiter/ar-3",),
    ),
    Mutation(
        name="data-to-all",
        file=SHARING,
        old='getattr(master, f"{channel}valid").eq(answers.o.valid & mine)',
        new='getattr(master, f"{channel}valid").eq(answers.o.valid)',
        what="a beat goes to every master",
        checks=("axi_read_arbiter/r-3",),
    ),
    Mutation(
        name="number-not-in-the-id",
        file=SHARING,
        old="Cat(any_of(each), number_of(chosen))",
        new="Cat(any_of(each))",
        what="all answers go to the first master",
        checks=(
            "axi_write_arbiter/aw-3",
            "axi_read_arbiter/ar-3",
        ),
    ),
    Mutation(
        name="answers-to-nobody-kept",
        file=SHARING,
        old="somebody = number < len(masters)",
        new="somebody = number >= 0",
        what="an answer whose id names no master stops all others",
        checks=(
            "axi_write_arbiter/b-3",
            "axi_read_arbiter/r-3",
        ),
    ),
    Mutation(
        name="early-answer-unseen",
        file=FOLLOWING,
        old="(before == whole.of(port.bid))",
        new="(before != whole.of(port.bid))",
        what="the checker takes answers to whole bursts for early ones",
        checks=("tests/rtl/memory/test_axi_checker.py::test_no_rule_is_named_while_all_are_kept",),
    ),
    Mutation(
        name="strobes-unseen",
        file=FOLLOWING,
        old="looks & (beats.head.strb & ~may).any()",
        new="looks & 0",
        what="the checker does not see strobes outside of a beat",
        checks=("tests/rtl/memory/test_axi_checker.py::test_bench",),
    ),
    Mutation(
        name="beats-of-nothing-unseen",
        file=FOLLOWING,
        old="awaited.eq(now.bursts != asked.of(port.rid))",
        new="awaited.eq(1)",
        what="the checker does not see beats of no burst",
        checks=("tests/rtl/memory/test_axi_checker.py::test_bench",),
    ),
)
