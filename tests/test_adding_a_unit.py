"""The unit of docs/adding_a_unit.md: its diff applies, and all that is said to follow from it does."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from lightloom.golden_model.contract.interfaces import UNITS
from tests import ROOT

UNIT = "half_add_saturating"
LONGEST = 120
"""Lines of the diff."""
PAGE = (ROOT / "docs" / "adding_a_unit.md").read_text(encoding="utf-8")
(DIFF,) = re.findall(r"^```diff\n(.*?)^```", PAGE, re.M | re.S)

PROGRAM = f"""
import sys
from pathlib import Path

import numpy as np

from lightloom.gen.formal.stream_units import properties
from lightloom.golden_model.contract import bitpack
from lightloom.golden_model.contract.interfaces import PURE
from lightloom.golden_model.models import model_results
from lightloom.hardware.benches import Run, bench_of
from lightloom.hardware.package_inputs import package_units
from lightloom.pages.units import page
from lightloom.rtl.catalogue import CATALOGUE
from lightloom.sim.bulk import BulkUnit
from lightloom.verif.vectors.unit_vectors import unit_vectors

unit, folder = {UNIT!r}, Path(sys.argv[1])
assert unit in CATALOGUE and unit in PURE
operands = unit_vectors(unit, 100_000, 1)
expected = model_results(unit, operands)
assert (np.abs(expected["z"]) == 65504).sum() > 100, "nothing saturates"
assert bitpack.equal(BulkUnit(unit).run(operands, stall_seed=3), expected).all()
bench = bench_of(unit)
assert bench.run(Run(folder=folder / "bench", config=bench.config)) == 8
assert [each.name for each in properties() if each.unit == unit] == ["stream-tiny", "stream-base", "stream-full"]
package_units([unit], "base", None, folder / "package")
assert f"## {{unit}}\\n" in page()
"""


def run(*words: str, cwd: Path) -> str:
    env = {**os.environ, "PYTHONPATH": str(cwd), "LIGHTLOOM_CACHE": str(ROOT / "build" / "sim")}
    done = subprocess.run(words, cwd=cwd, env=env, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def changed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the checkout with the diff applied."""
    copy = tmp_path_factory.mktemp("copy")
    listed = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    for name in listed.splitlines():
        (copy / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, copy / name, follow_symlinks=False)
    applied = subprocess.run(["git", "apply", "--recount", "-"], cwd=copy, input=DIFF, text=True, capture_output=True)
    assert applied.returncode == 0, applied.stderr
    return copy


def test_it_is_short() -> None:
    assert UNIT not in UNITS
    assert len(DIFF.splitlines()) < LONGEST


def test_everything_follows_from_it(changed: Path, tmp_path: Path) -> None:
    run(sys.executable, "-c", PROGRAM, str(tmp_path), cwd=changed)
    package = tmp_path / "package"
    said = run("make", f"test-{UNIT}", cwd=package)
    assert f"PASS {UNIT}" in said
    proved = run(str(Path(sys.executable).with_name("lightloom")), "prove", UNIT, cwd=changed)
    assert "3 of 3 proved" in proved


def test_the_rules_of_the_rooms_hold(changed: Path) -> None:
    options = ["-q", "-p", "no:xdist", "-p", "no:cacheprovider"]
    run(sys.executable, "-m", "pytest", *options, "tests/test_rooms.py", cwd=changed)


def test_the_smallest_unit(tmp_path: Path) -> None:
    """A unit that is in no table of the checkout is emitted, simulated and compared."""
    said = run(sys.executable, str(ROOT / "examples" / "minimal_unit" / "minimal_unit.py"), str(tmp_path), cwd=ROOT)
    assert "all 65,536 sums are the model's" in said
    assert (tmp_path / "byte_sum.v").read_text(encoding="utf-8").count("module byte_sum") == 2
