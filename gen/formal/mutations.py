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

from lightloom.golden_model.host.errors import InputError

ROOT = Path(__file__).parents[3]  # this is lightloom/gen/formal/mutations.py
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
            shutil.copytree(
                ROOT / package, folder / package, symlinks=True, ignore=shutil.ignore_patterns("__pycache__")
            )
        shutil.copy(ROOT / "pyproject.toml", folder)
        if one is not None:
            path = folder / one.file
            path.write_text(path.read_text(encoding="utf-8").replace(one.old, one.new), encoding="utf-8")
        yield folder
