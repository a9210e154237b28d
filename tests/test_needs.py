"""Tests that lack what they need are left out, but not in continuous integration."""

import re

import pytest

from tests import ROOT
from tests.needs import need, need_package, needs

ABSENT = "lightloom_has_no_such_module"


@pytest.fixture(params=[True, False], ids=["integration", "elsewhere"])
def integration(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> bool:
    """Whether this is continuous integration."""
    if request.param:
        monkeypatch.setenv("CI", "true")
    else:
        monkeypatch.delenv("CI", raising=False)
    return bool(request.param)


def test_the_mark(integration: bool) -> None:
    assert needs(False, "none").args == (not integration,)
    assert needs(True, "none").args == (False,)
    assert needs(False, "none", optional=True).args == (True,)


def test_within_a_test(integration: bool) -> None:
    need(True, "none")
    with pytest.raises(pytest.fail.Exception if integration else pytest.skip.Exception, match=r"^no meshes$"):
        need(False, "no meshes")
    with pytest.raises(pytest.skip.Exception, match=r"^no meshes$"):
        need(False, "no meshes", optional=True)


def test_a_package(integration: bool) -> None:
    assert need_package("numpy", "none").__name__ == "numpy"
    with pytest.raises(ModuleNotFoundError if integration else pytest.skip.Exception):
        need_package(ABSENT, "none")


def test_nothing_else_leaves_tests_out() -> None:
    leaves_out = re.compile(r"importorskip|\bskipif\b|\bskip\(|\bunittest\.skip|environ.*\bCI\b")
    helpers = {ROOT / "tests" / name for name in ("needs.py", "test_needs.py")}
    wrong = [
        f"{path.relative_to(ROOT)}:{number}: {line.strip()}"
        for folder in ("tests", "verif", "examples")
        for path in sorted((ROOT / folder).rglob("*.py"))
        if path not in helpers
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1)
        if leaves_out.search(line)
    ]
    assert not wrong, "\n".join(wrong)
