"""Seeded faults: the RTL with one thing wrong at a time, and the proofs and tests that have to notice.

A proof that nothing can fail proves nothing. Each fault is put into a copy of the packages, in which the checks that
are to catch it then run; the checks run once on the copy without a fault, too, and have to pass there.
"""

import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from golden_model.errors import InputError

ROOT = Path(__file__).parent.parent.parent
PACKAGES = ("gen", "golden_model", "lightloom", "rtl", "sim", "tests", "verif")
PROVE = "import sys; from lightloom.cli import run; sys.exit(run(sys.argv[1:]))"
LIMIT = 600
"""Seconds for one check: a fault may make a test hang, which counts as noticed."""


@dataclass(frozen=True, kw_only=True)
class Mutation:
    """One fault."""

    name: str
    file: str
    old: str
    """Text that is in the file exactly once."""
    new: str
    what: str
    """What is wrong then, in a few words."""
    checks: tuple[str, ...]
    """What has to catch it: properties as UNIT/NAME, tests as tests/FILE.py::NAME."""
    equivalent: str = ""
    """Why nothing can catch it, where that is so."""


def run(
    chosen: Sequence[Mutation], jobs: int, done: Callable[[dict[str, Any]], None] = lambda row: None
) -> list[dict[str, Any]]:
    """Rows of a table: each fault with the checks that caught it, "" for none, in the order given.

    Raises InputError where a fault's text is not in its file exactly once, where the tests are not there, and where a
    check fails without any fault.
    """
    if not (ROOT / "tests").is_dir():
        raise InputError(f"{ROOT}: no tests here; run it in the project's folder")
    for one in chosen:
        found = (ROOT / one.file).read_text(encoding="utf-8").count(one.old)
        if found != 1:
            raise InputError(f"fault {one.name}: its text is {found} times in {one.file}; bring the list up to date")
    rows: dict[int, dict[str, Any]] = {}
    with ThreadPoolExecutor(jobs) as pool:
        try:
            checks = list(dict.fromkeys(check for one in chosen for check in one.checks))
            sound = {pool.submit(_fails, None, check): check for check in checks}
            for future in as_completed(sound):
                if future.result():
                    raise InputError(f"{sound[future]}: fails without any fault; mend that first")
            faults = {pool.submit(_row, one): k for k, one in enumerate(chosen)}
            for fault in as_completed(faults):
                rows[faults[fault]] = fault.result()
                done(rows[faults[fault]])
        finally:
            pool.shutdown(cancel_futures=True)  # after an interrupt or an error nothing new is begun
    return [rows[k] for k in range(len(chosen))]


def _row(one: Mutation) -> dict[str, Any]:
    started = time.perf_counter()
    caught = [check for check in one.checks if _fails(one, check)]
    return {
        "fault": one.name,
        "file": one.file,
        "what is wrong": one.what,
        "checks": ", ".join(one.checks),
        "caught by": ", ".join(caught),
        "equivalent": one.equivalent,
        "seconds": round(time.perf_counter() - started, 1),
    }


def _fails(one: Mutation | None, check: str) -> bool:
    """Whether a check finds something wrong in a copy of the packages with a fault (with none: as they are)."""
    with _copy(one) as folder:
        if check.startswith("tests/"):
            arguments = ["-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", check]
        else:
            arguments = ["-c", PROVE, "prove", check, "--jobs", "1"]
        environment = {**os.environ, "PYTHONPATH": str(folder), "PYTHONDONTWRITEBYTECODE": "1"}
        try:
            ran = subprocess.run(
                [sys.executable, *arguments],
                cwd=folder,
                env=environment,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                text=True,
                timeout=LIMIT,
            )
        except subprocess.TimeoutExpired:
            return True
        # 1: a test or a property has failed. Anything else says nothing about the RTL.
        if ran.returncode not in (0, 1):
            last = (ran.stdout.strip().splitlines() or ["no message"])[-1]
            raise RuntimeError(f"{check} with {one.name if one else 'no fault'}: code {ran.returncode}: {last}")
        return ran.returncode == 1


@contextmanager
def _copy(one: Mutation | None) -> Iterator[Path]:
    """The packages and tests in a folder of their own, with the fault."""
    with tempfile.TemporaryDirectory(prefix="lightloom-fault-") as scratch:
        folder = Path(scratch)
        for package in PACKAGES:
            shutil.copytree(ROOT / package, folder / package, ignore=shutil.ignore_patterns("__pycache__"))
        shutil.copy(ROOT / "pyproject.toml", folder)
        if one is not None:
            path = folder / one.file
            path.write_text(path.read_text(encoding="utf-8").replace(one.old, one.new), encoding="utf-8")
        yield folder


# --- the list ---------------------------------------------------------------------------------------------------------

OPERATORS = "rtl/operators/"
PIPELINE, QUEUES, FILL = "rtl/pipeline.py", "rtl/queues.py", "rtl/block_fill.py"
STREAM = ("float_add/stream-tiny",)
_MUTATIONS = (
    Mutation(
        name="stall-ignored",
        file=PIPELINE,
        old="advance.eq(~valid | self.o.ready if self.latency else self.o.ready)",
        new="advance.eq(self.o.ready | 1)",
        what="results do not wait",
        checks=STREAM,
    ),
    Mutation(
        name="bubbles-kept",
        file=PIPELINE,
        old="advance.eq(~valid | self.o.ready if self.latency else self.o.ready)",
        new="advance.eq(self.o.ready)",
        what="ready depends on the output alone",
        checks=STREAM,
    ),
    Mutation(
        name="valid-moves-alone",
        file=PIPELINE,
        old='            held = Signal(name=f"valid{stage}")\n            with m.If(advance):',
        new='            held = Signal(name=f"valid{stage}")\n            with m.If(advance | (stage == 0)):',
        what="the first stage takes while the pipeline stands",
        checks=STREAM,
    ),
    Mutation(
        name="valid-not-reset",
        file=PIPELINE,
        old='            held = Signal(name=f"valid{stage}")\n',
        new='            held = Signal(name=f"valid{stage}", reset_less=True)\n',
        what="something may come out after reset",
        checks=STREAM,
    ),
    Mutation(
        name="ready-always",
        file=PIPELINE,
        old="self.i.ready.eq(taking)",
        new="self.i.ready.eq(1)",
        what="an operation is lost in a stall",
        checks=STREAM,
    ),
    Mutation(
        name="phase-stuck",
        file=PIPELINE,
        old="m.d.sync += phase.eq(~phase)",
        new="m.d.sync += phase.eq(1)",
        what="a core of interval 2 gets operations in every cycle",
        checks=("ray_triangle_half/stream-tiny",),
    ),
    Mutation(
        name="buffer-overwrites",
        file=QUEUES,
        old="keeps.eq(~moves & ~held)",
        new="keeps.eq(~moves)",
        what="the second register is overwritten while it waits",
        checks=("buffer/stream",),
    ),
    Mutation(
        name="buffer-forgets",
        file=QUEUES,
        old="self.o.valid.eq(held | self.i.valid), held.eq(0)",
        new="self.o.valid.eq(self.i.valid), held.eq(0)",
        what="what waits in the second register is lost",
        checks=("buffer/stream",),
    ),
    Mutation(
        name="buffer-doubles",
        file=QUEUES,
        old="self.o.valid.eq(held | self.i.valid), held.eq(0)",
        new="self.o.valid.eq(held | self.i.valid)",
        what="the second register is given twice",
        checks=("buffer/stream",),
    ),
    Mutation(
        name="queue-too-short",
        file=QUEUES,
        old="depth=max(self.depth + 1, 3)",
        new="depth=max(self.depth, 3)",
        what="a place too few",
        checks=("queue/depth8",),
    ),
    Mutation(
        name="free-number-repeats",
        file=QUEUES,
        old="any_fresh.eq(fresh != self.count)",
        new="any_fresh.eq(fresh <= self.count)",
        what="numbers beyond the last are given away",
        checks=("free_list/count3",),
    ),
    Mutation(
        name="free-number-stays",
        file=QUEUES,
        old="            with m.If(self.o.ready):\n                m.d.sync += fresh.eq(fresh + 1)",
        new="            with m.If(self.o.ready & ~self.i.valid):\n                m.d.sync += fresh.eq(fresh + 1)",
        what="a number is given twice when another comes back",
        checks=("free_list/count3",),
    ),
    Mutation(
        name="beats-not-cleared",
        file=FILL,
        old="Mux(after & ~last, chosen, 0)",
        new="Mux(after, chosen, 0)",
        what="the number of the next beat is not cleared with the last one",
        checks=("block_fill/beats-128",),
        equivalent="blocks come whole: after the last beat the number wraps to zero by itself",
    ),
    Mutation(
        name="error-stays",
        file=FILL,
        old="Mux(self.error & ~last, chosen, 0)",
        new="Mux(self.error, chosen, 0)",
        what="the next block of a miss that failed fails too",
        checks=("block_fill/beats-128",),
    ),
    Mutation(
        name="error-forgotten",
        file=FILL,
        old="beat_failed | failed.bit_select(self.miss, 1)",
        new="beat_failed",
        what="an error before the last beat is not told",
        checks=("block_fill/beats-128",),
    ),
    Mutation(
        name="ties-up",
        file=OPERATORS + "fields.py",
        old="up.eq(guard & (sticky | kept[0]))",
        new="up.eq(guard)",
        what="ties are rounded up, not to even",
        checks=("float_add/every-6-bit-input",),
    ),
    Mutation(
        name="flush-tie",
        file=OPERATORS + "fields.py",
        old="carry.eq(kept.all() & (guard | least))",
        new="carry.eq(kept.all() & guard)",
        what="what rounds up to the least normal number is flushed",
        checks=("float_multiply/every-6-bit-input",),
    ),
    Mutation(
        name="overflow-late",
        file=OPERATORS + "fields.py",
        old="over.eq((exponent >= f.infinity)",
        new="over.eq((exponent > f.infinity)",
        what="a result just too large is no infinity",
        checks=("float_multiply/every-6-bit-input", "float_add/every-6-bit-input"),
    ),
    Mutation(
        name="nan-with-sign",
        file=OPERATORS + "fields.py",
        old="sign & ~nan,",
        new="sign,",
        what="there are two NaNs",
        checks=("float_add/special-cases",),
    ),
    Mutation(
        name="carry-fraction",
        file=OPERATORS + "fields.py",
        old="fraction=total[: f.fraction_bits] & ~carry.replicate(f.fraction_bits)",
        new="fraction=total[: f.fraction_bits]",
        what="a rounding that carries out into the flushed range keeps its ones",
        checks=("float_multiply/every-6-bit-input",),
    ),
    Mutation(
        name="add-signed-order",
        file=OPERATORS + "float_add.py",
        old="swap.eq(a[:-1] < b[:-1])",
        new="swap.eq(a < b)",
        what="operands ordered with their signs",
        checks=("float_add/every-6-bit-input",),
    ),
    Mutation(
        name="add-sticky-lost",
        file=OPERATORS + "float_add.py",
        old="scaled[:3].any()",
        new="scaled[1:3].any()",
        what="one bit of the sticky bit is missing",
        checks=("float_add/every-8-bit-input",),
    ),
    Mutation(
        name="add-exponent",
        file=OPERATORS + "float_add.py",
        old="biased.eq(exponent + 1 - zeros)",
        new="biased.eq(exponent - zeros)",
        what="exponent of a sum off by one",
        checks=("float_add/every-6-bit-input",),
    ),
    Mutation(
        name="add-zero-sign",
        file=OPERATORS + "float_add.py",
        old="sign=sign & ~(zero & differ)",
        new="sign=sign",
        what="x - x has the sign of x",
        checks=("float_add/special-cases",),
    ),
    Mutation(
        name="add-infinities",
        file=OPERATORS + "float_add.py",
        old='"nan": x.nan | y.nan | (x.infinite & y.infinite & differ)',
        new='"nan": x.nan | y.nan',
        what="infinity less infinity is no NaN",
        checks=("float_add/special-cases",),
    ),
    Mutation(
        name="align-sticky",
        file=OPERATORS + "shifts.py",
        old="fallen.eq(lost | (far & value[:places].any()))",
        new="fallen.eq(far & value[:places].any())",
        what="what an earlier step of a shift lost is forgotten",
        checks=("float_add/every-6-bit-input", "float_difference_of_products/every-5-bit-input"),
    ),
    Mutation(
        name="multiply-bias",
        file=OPERATORS + "float_multiply.py",
        old="x.exponent + y.exponent - f.bias",
        new="x.exponent + y.exponent - f.bias + 1",
        what="exponent of a product off by one",
        checks=("float_multiply/every-6-bit-input",),
    ),
    Mutation(
        name="multiply-sticky",
        file=OPERATORS + "float_multiply.py",
        old="whole[:below].any() | (top & whole[below])",
        new="whole[:below].any()",
        what="the bit that a long product shifts out is lost",
        checks=("float_multiply/every-8-bit-input",),
    ),
    Mutation(
        name="multiply-special",
        file=OPERATORS + "float_multiply.py",
        old=" | (x.zero & y.infinite),",
        new=",",
        what="zero times infinity is no NaN",
        checks=("float_multiply/special-cases",),
    ),
    Mutation(
        name="product-row",
        file=OPERATORS + "product.py",
        old="thrice.eq(high & low),",
        new="thrice.eq(high),",
        what="a digit 2 takes the row of 3 as well",
        checks=("float_multiply/every-6-bit-input",),
    ),
    Mutation(
        name="divide-order",
        file=OPERATORS + "float_divide.py",
        old="difference.eq(remainder - divisor)",
        new="difference.eq(divisor - remainder)",
        what="operands of the trial subtraction swapped",
        checks=("float_divide/every-6-bit-input",),
    ),
    Mutation(
        name="divide-sticky",
        file=OPERATORS + "float_divide.py",
        old="remainder.any() | (~below & quotient[0])",
        new="remainder.any()",
        what="the last bit of a long quotient is lost",
        checks=("float_divide/every-6-bit-input",),
        equivalent="a quotient without remainder has no more bits than a significand: its last bit here is zero",
    ),
    Mutation(
        name="sqrt-parity",
        file=OPERATORS + "float_sqrt.py",
        old="odd = ~x.exponent[0]",
        new="odd = x.exponent[0]",
        what="odd and even powers exchanged",
        checks=("float_sqrt/every-8-bit-input",),
    ),
    Mutation(
        name="sqrt-of-minus-zero",
        file=OPERATORS + "float_sqrt.py",
        old="x.nan | (x.sign & ~x.zero)",
        new="x.nan | x.sign",
        what="the root of -0 is a NaN",
        checks=("float_sqrt/special-cases",),
    ),
    Mutation(
        name="difference-swapped",
        file=OPERATORS + "float_difference_of_products.py",
        old='"smaller": Mux(swap, p, q)',
        new='"smaller": Mux(swap, q, p)',
        what="one product is taken twice",
        checks=("float_difference_of_products/every-5-bit-input",),
    ),
    Mutation(
        name="difference-negative",
        file=OPERATORS + "float_difference_of_products.py",
        old="negative.eq(differ & ~forward[width])",
        new="negative.eq(~forward[width])",
        what="sums are turned over, too",
        checks=("float_difference_of_products/every-5-bit-input",),
    ),
    Mutation(
        name="compare-zeros",
        file=OPERATORS + "float_compare.py",
        old="(x.zero & y.zero) | (Value",
        new="(Value",
        what="-0 is less than +0",
        checks=("float_compare/every-6-bit-input", "float_compare/special-cases"),
    ),
    Mutation(
        name="minmax-turned",
        file=OPERATORS + "float_minmax.py",
        old="below == maximum",
        new="below != maximum",
        what="minimum and maximum exchanged",
        checks=("float_minmax/every-6-bit-input", "float_minmax/special-cases"),
    ),
    Mutation(
        name="slope-interval",
        file="rtl/box_axis.py",
        old="Mux(~way[-1] if far else way[-1], slope + 1, slope)",
        new="Mux(way[-1] if far else ~way[-1], slope + 1, slope)",
        what="the slope is rounded inwards",
        checks=("node_test/no-false-reject-near",),
    ),
    Mutation(
        name="short-slope-down",
        file="rtl/box_axis.py",
        old="return short + 1 if far else short",
        new="return short",
        what="the far planes' short slope is rounded down",
        checks=("node_test/no-false-reject-near",),
    ),
    Mutation(
        name="saturates-inwards",
        file="rtl/box_axis.py",
        old="Mux(saturates, (~sign).replicate(size), shifted)",
        new="Mux(saturates, sign.replicate(size), shifted)",
        what="saturated distances are at the wrong end",
        checks=("node_test/no-false-reject-near",),
    ),
    Mutation(
        name="planes-exchanged",
        file="rtl/box_axis.py",
        old="list(zip(upper, lower, strict=True))",
        new="list(zip(lower, upper, strict=True))",
        what="the far plane is the near one",
        checks=("node_test/no-false-reject-near",),
    ),
    Mutation(
        name="turn-forgotten",
        file="rtl/one_hot.py",
        old="above.eq(Mux(some, above_higher, above_wanted))",
        new="above.eq(0)",
        what="the first master always goes first",
        checks=("axi_read_arbiter/ar-3",),
    ),
    Mutation(
        name="address-to-all",
        file="rtl/axi_read_arbiter.py",
        old="master.arready.eq(chosen[k] & addresses.i.ready)",
        new="master.arready.eq(addresses.i.ready)",
        what="an address is taken from every master",
        checks=("axi_read_arbiter/ar-3",),
    ),
    Mutation(
        name="data-to-all",
        file="rtl/axi_read_arbiter.py",
        old="master.rvalid.eq(beats.o.valid & mine)",
        new="master.rvalid.eq(beats.o.valid)",
        what="a beat goes to every master",
        checks=("axi_read_arbiter/r-3",),
    ),
    Mutation(
        name="counts-twice",
        file="rtl/traversal/counters.py",
        old="count.eq(count + 1)",
        new="count.eq(count + 2)",
        what="an event counts twice",
        checks=("counters/count",),
    ),
    Mutation(
        name="list-never-starts",
        file="rtl/waiters.py",
        old="ends.eq(~self.o.valid | walk.data.last)",
        new="ends.eq(walk.data.last)",
        what="a list begins where the last one ended, or not at all",
        checks=("waiters/lists-1x2",),
    ),
    Mutation(
        name="list-without-end",
        file="rtl/waiters.py",
        old='link.data.last.eq(register(m, self.add, self.first, "first_d1"))',
        new="link.data.last.eq(1)",
        what="every request is the last of its list",
        checks=("waiters/lists-1x2",),
    ),
    Mutation(
        name="drain-over-hit",
        file="rtl/block_cache.py",
        old="drain.ready.eq(can_answer & ~hit_first)",
        new="drain.ready.eq(can_answer)",
        what="an answer is lost where a hit comes at the same time",
        checks=("tests/rtl/test_block_cache.py::test_hits_go_first_but_not_for_ever",),
    ),
    Mutation(
        name="line-not-locked",
        file="rtl/block_lines.py",
        old="locked[way].eq(locked[way] & ~released[way] | given)",
        new="locked[way].eq(locked[way] & ~released[way] & ~given)",
        what="a line gives way while requests wait for it",
        checks=("block_lines/where-a-block-is",),
    ),
    Mutation(
        name="label-read-before",
        file="rtl/block_lines.py",
        old="Mux(replaced, same_name, reads.data.name == read_name)",
        new="reads.data.name == read_name",
        what="a block is not found where the one before it has just been put",
        checks=("block_lines/where-a-block-is",),
    ),
    Mutation(
        name="stack-upside-down",
        file="rtl/traversal/stacks.py",
        old="index.eq(item.last - done)",
        new="index.eq(item.first + done)",
        what="the farthest child is on top",
        checks=("stacks/entries",),
    ),
    Mutation(
        name="visits-over-limit",
        file="rtl/traversal/control.py",
        old="outstanding.below(overlap))",
        new="outstanding.below(overlap + 1))",
        what="one visit too many under way",
        checks=("tests/rtl/test_control.py",),
    ),
    Mutation(
        name="node-visit-counts-on",
        file="rtl/traversal/control.py",
        old='("node", node_end)',
        new='("node", node_fail)',
        what="a node that leads nowhere never ends",
        checks=("tests/rtl/test_control.py",),
    ),
    Mutation(
        name="finished-too-early",
        file="rtl/traversal/control.py",
        old="settled & ~some_height & ~fresh & ~restart",
        new="settled & ~fresh & ~restart",
        what="a ray is finished while visits wait on its stack",
        checks=("tests/rtl/test_control.py",),
    ),
    Mutation(
        name="half-sticky",
        file=OPERATORS + "float_to_half.py",
        old="shifted[:12].any() | lost",
        new="shifted[1:12].any() | lost",
        what="the lowest bit of a float does not break a tie",
        checks=("float_to_half/every-upper-part",),
    ),
    Mutation(
        name="rounding-lost",
        file="rtl/box_axis.py",
        old="rows.append(Const(2 << (slope - 1), width))",
        new="rows.append(Const(1 << (slope - 1), width))",
        what="the far distance is rounded up once instead of twice",
        checks=("node_test/as-the-model",),
    ),
    Mutation(
        name="pad-inwards",
        file="rtl/box_axis.py",
        old="wide_pad if far else ~wide_pad]",
        new="wide_pad]",
        what="the near planes are moved inwards",
        checks=("node_test/no-false-reject-near",),
    ),
    Mutation(
        name="corner-of-forward-rays",
        file="rtl/box_axis.py",
        old="last = Mux(backwards, (1 << widths.arithmetic.plane) - 1, 0)",
        new="last = 0",
        what="rays that go backwards count planes from the wrong corner",
        checks=("node_test/no-false-reject-near",),
    ),
)
MUTATIONS = {one.name: one for one in _MUTATIONS}
"""By name."""
