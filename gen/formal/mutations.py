"""Seeded faults: the RTL with one thing wrong at a time, and the proofs and tests that have to notice.

A proof that nothing can fail proves nothing. Each fault is put into a copy of the packages, in which the checks that
are to catch it then run; the checks run once on the copy without a fault, too, and have to pass there.

What a check said is kept below build/ until a file of the packages changes: what an interrupted run had done, the next
one takes.
"""

import hashlib
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Literal

from lightloom.golden_model.host.errors import InputError
from lightloom.golden_model.host.outputs import whole_file

ROOT = Path(__file__).parents[3]  # this is lightloom/gen/formal/mutations.py
PACKAGES = ("gen", "golden_model", "lightloom", "rtl", "sim", "tests", "verif")
PROVE = "import sys; from lightloom.cli import run; sys.exit(run(sys.argv[1:]))"
LIMIT = 600
"""Seconds of processor time for each program of a check: a fault may make a test hang. Solvers have their own limit."""
LIMITED = 'ulimit -S -c 0; ulimit -S -t "$0"; exec "$@"'
"""For the shell: time by the clock would depend on what else the machine does."""
KEPT = ROOT / "build" / "faults"
"""Where answers of checks are kept."""
Said = Literal["passed", "failed", "no answer"]
"""What a check says; a solver that finds none in its time has noticed nothing."""


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
    said = partial(_kept, _state())
    with ThreadPoolExecutor(jobs) as pool:
        try:
            checks = list(dict.fromkeys(check for one in chosen for check in one.checks))
            sound = {pool.submit(said, None, check): check for check in checks}
            for future in as_completed(sound):
                if future.result() != "passed":
                    raise InputError(f"{sound[future]}: {future.result()} without any fault; mend that first")
            faults = {pool.submit(_row, one, said): k for k, one in enumerate(chosen)}
            for fault in as_completed(faults):
                rows[faults[fault]] = fault.result()
                done(rows[faults[fault]])
        finally:
            pool.shutdown(cancel_futures=True)  # after an interrupt or an error nothing new is begun
    return [rows[k] for k in range(len(chosen))]


def _row(one: Mutation, said: Callable[[Mutation, str], Said]) -> dict[str, Any]:
    started = time.perf_counter()
    caught = [check for check in one.checks if said(one, check) == "failed"]
    return {
        "fault": one.name,
        "file": one.file,
        "what is wrong": one.what,
        "checks": ", ".join(one.checks),
        "caught by": ", ".join(caught),
        "equivalent": one.equivalent,
        "seconds": round(time.perf_counter() - started, 1),
    }


def _state() -> str:
    """A digest of all files that a check may depend on."""
    digest = hashlib.sha256()
    for path in sorted(path for package in PACKAGES for path in (ROOT / package).rglob("*") if path.is_file()):
        if "__pycache__" not in path.parts:
            text = path.read_bytes()
            digest.update(f"{path.relative_to(ROOT)} {len(text)}\n".encode() + text)
    return digest.hexdigest()


def _kept(state: str, one: Mutation | None, check: str) -> Said:
    """What `_said` says of the files in that state, now or in an earlier run."""
    parts = (state, check, *((one.file, one.old, one.new) if one else ()))
    file = KEPT / f"{hashlib.sha256(chr(0).join(parts).encode()).hexdigest()[:16]}.json"
    if not file.exists():
        answer = {"fault": one.name if one else None, "check": check, "said": _said(one, check)}
        with whole_file(file) as part:
            part.write_text(json.dumps(answer) + "\n", encoding="utf-8")
    said: Said = json.loads(file.read_text(encoding="utf-8"))["said"]
    return said


def _said(one: Mutation | None, check: str) -> Said:
    """What a check says of a copy of the packages with a fault (with none: as they are)."""
    with _copy(one) as folder:
        if check.startswith("tests/"):
            arguments = ["-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", check]
        else:
            arguments = ["-c", PROVE, "prove", check, "--jobs", "1", "--json"]
        ran = subprocess.run(
            ["/bin/sh", "-c", LIMITED, str(LIMIT), sys.executable, *arguments],
            cwd=folder,
            env={**os.environ, "PYTHONPATH": str(folder), "PYTHONDONTWRITEBYTECODE": "1"},
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        # 1: a test or a property has failed. Anything else but a test that hangs says nothing about the RTL.
        if ran.returncode not in (0, 1, -signal.SIGXCPU):
            last = (ran.stdout.strip().splitlines() or ["no message"])[-1]
            raise RuntimeError(f"{check} with {one.name if one else 'no fault'}: code {ran.returncode}: {last}")
        if '"status": "timed out"' in ran.stdout:
            return "no answer"
        return "failed" if ran.returncode else "passed"


@contextmanager
def _copy(one: Mutation | None) -> Iterator[Path]:
    """The packages and tests in a folder of their own, with the fault."""
    with tempfile.TemporaryDirectory(prefix="lightloom-fault-") as scratch:
        folder = Path(scratch)
        for package in PACKAGES:
            shutil.copytree(
                ROOT / package, folder / package, symlinks=True, ignore=shutil.ignore_patterns("__pycache__")
            )
        shutil.copy(ROOT / "pyproject.toml", folder)
        if one is not None:
            path = folder / one.file
            path.write_text(path.read_text(encoding="utf-8").replace(one.old, one.new), encoding="utf-8")
        yield folder
