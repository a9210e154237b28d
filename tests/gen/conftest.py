"""Every unit emitted once a preset, for all tests of this folder and all workers of a run."""

import os
from collections.abc import Callable
from pathlib import Path

import pytest

from lightloom.gen.emit import emit
from lightloom.rtl.config import PRESETS
from lightloom.sim import emitted as cache
from lightloom.sim import toolchain


@pytest.fixture(scope="session")
def emitted(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """The folder with every unit of a preset, whose texts come from the simulators' cache where that holds them."""
    own = tmp_path_factory.getbasetemp()
    shared = own.parent if "PYTEST_XDIST_WORKER" in os.environ else own  # the workers' folders lie in the run's

    def folder(preset: str) -> Path:
        path = shared / "emitted" / preset
        with toolchain.locked(path), pytest.MonkeyPatch.context() as patch:
            patch.setattr("lightloom.gen.emit.verilog_of", cache.emitted)
            if not path.exists():
                emit(None, PRESETS[preset], preset, path)
        return path

    return folder


@pytest.fixture(scope="session")
def base(emitted: Callable[[str], Path]) -> Path:
    return emitted("base")
