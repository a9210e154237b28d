"""Steps of long jobs, kept by what they depend on: a second run, or one that goes on, does only what is new."""

import hashlib
import json
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from lightloom.golden_model.host.outputs import whole_file
from lightloom.sim import toolchain


def kept(file: Path, make: Callable[[], dict[str, Any]]) -> tuple[dict[str, Any], float]:
    """What `make` gave when it was run, now or earlier, and how many seconds it took then; kept in `file` as JSON.

    Parallel runs make it once. `make` may write further files into the folder of `file`, which is there by then.
    """
    with toolchain.locked(file):
        if not file.exists():
            started = time.perf_counter()
            made = make()
            with whole_file(file) as part:
                part.write_text(json.dumps({"made": made, "seconds": time.perf_counter() - started}), encoding="utf-8")
        found = json.loads(file.read_text(encoding="utf-8"))
    return found["made"], found["seconds"]


def key_of(*parts: str) -> str:
    """A short name for everything that a step depends on."""
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()[:16]
