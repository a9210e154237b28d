"""Every unit emitted once a preset, for all tests of this folder."""

from collections.abc import Callable
from functools import cache
from pathlib import Path

import pytest

from gen.emit import emit
from rtl.config import PRESETS


@pytest.fixture(scope="session")
def emitted(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """The folder with every unit of a preset."""

    @cache
    def folder(preset: str) -> Path:
        path = tmp_path_factory.mktemp("emit") / preset
        emit(None, PRESETS[preset], preset, path)
        return path

    return folder


@pytest.fixture(scope="session")
def base(emitted: Callable[[str], Path]) -> Path:
    return emitted("base")
