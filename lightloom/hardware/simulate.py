"""Runs the cocotb bench of a unit and tells what became of each of its tests, and where its waves are."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from lightloom.gen.manifest import manifest
from lightloom.golden_model.host.errors import InputError
from lightloom.hardware.benches import Run, bench_of
from lightloom.sim.runner import BenchError, NoTestError
from lightloom.sim.waves import save_file


@dataclass(frozen=True)
class Simulated:
    """What a run of a bench has shown."""

    tests: list[Mapping[str, Any]]
    """Of each test its name, whether it `passed`, its `seconds`, and `message`, why it failed or ""."""
    passed: bool
    """All have, and there was one."""
    files: dict[str, str] = field(default_factory=dict)
    """Names in the folder of the run: `log`, and `waves` and `save` where waves were wanted."""


def simulate(unit: str, run: Run) -> Simulated:
    """Runs the bench of a unit. Raises InputError where a tool is missing, or where `only` leaves no test."""
    bench = bench_of(unit)
    try:
        bench.run(run)
        passed = True
    except NoTestError as error:
        if not run.only:
            raise
        raise InputError(f"--only {run.only}: no test of {unit} has such a name") from error
    except BenchError:
        passed = False
    files = {"log": "log.txt"}
    if run.waves:
        files |= {"waves": f"{bench.top}.fst", "save": f"{bench.top}.gtkw"}
        save_file(run.folder / files["save"], run.folder / files["waves"], manifest(unit, run.config), bench.top)
    return Simulated(list(_tests(run.folder / "results.xml")), passed, files)


def _tests(path: Path) -> list[Mapping[str, Any]]:
    """The tests of a file of results in JUnit's format; none where there is no such file."""
    if not path.exists():
        return []
    cases = ElementTree.parse(path).iter("testcase")
    return [
        {
            "test": case.get("name", ""),
            "passed": case.find("failure") is None and case.find("error") is None,
            "seconds": float(case.get("time", 0)),
            "message": next((part.get("message", "") for part in case if part.tag in ("failure", "error")), ""),
        }
        for case in cases
        if case.find("skipped") is None
    ]
