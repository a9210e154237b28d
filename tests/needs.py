"""What a test needs that a machine may not have: programs, packages, meshes.

A test that lacks it is left out, with the reason. In continuous integration (`CI` is set) it fails instead, so that
none is left out unnoticed; but for what neither `.ci/setup` nor `requirements.lock` installs, which is optional.
"""

import os
from importlib import import_module
from importlib.util import find_spec
from typing import Any

import pytest


def needs(there: bool, reason: str, *, optional: bool = False) -> pytest.MarkDecorator:
    """The mark of tests that need something. In continuous integration they run without it, and fail."""
    return pytest.mark.skipif(not there and _may_lack(optional), reason=reason)


def need(there: bool, reason: str, *, optional: bool = False) -> None:
    """The same within a test."""
    if not there:
        (pytest.skip if _may_lack(optional) else pytest.fail)(reason)


def need_package(module: str, reason: str) -> Any:
    """A module of a package that requirements.lock has."""
    return pytest.importorskip(module, reason=reason) if _may_lack() else import_module(module)


def _may_lack(optional: bool = False) -> bool:
    return optional or not os.environ.get("CI")


needs_numba = needs(find_spec("numba") is not None, "numba is not installed")
