"""The package of a few small units: its own checks, its bytes, and what is asked for wrongly."""

import hashlib
import json
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from lightloom.gen.package.package import package
from lightloom.golden_model.host.errors import InputError
from lightloom.hardware.package_inputs import CLOCKS, package_units
from lightloom.rtl.catalogue import CATALOGUE
from lightloom.rtl.config import PRESETS
from tests import ROOT
from tests.needs import need_package
from tests.simulators import needs_icarus

UNITS = ["float_compare", "half_to_float", "ray_time"]
PROGRAMS = ("make", "sh", "iverilog", "vvp", "sha256sum", "mkdir", "cat", "grep", "rm")
"""All that `make check` needs."""


@pytest.fixture(scope="module")
def tiny(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("package") / "tiny"
    package_units(UNITS, "tiny", None, folder)
    return folder


@pytest.fixture
def copy(tiny: Path, tmp_path: Path) -> Path:
    """The package elsewhere."""
    return Path(shutil.copytree(tiny, tmp_path / "else where" / "package"))


def make(folder: Path, target: str = "check") -> subprocess.CompletedProcess[str]:
    """Runs make in a package with nothing on PATH but what it needs: no Python."""
    programs = folder.parent / "bin"
    programs.mkdir(exist_ok=True)
    for name in PROGRAMS:
        found = shutil.which(name)
        assert found, name
        if not (programs / name).exists():
            (programs / name).symlink_to(found)
    env = {"PATH": str(programs), "HOME": str(folder.parent), "LC_ALL": "C"}
    return subprocess.run(["make", target], cwd=folder, env=env, capture_output=True, text=True)


def sign(folder: Path) -> None:
    """Writes the checksums of files that have been changed on purpose."""
    lines = []
    for line in (folder / "SHA256SUMS").read_text().splitlines():
        name = line.split("  ", 1)[1]
        lines.append(f"{hashlib.sha256((folder / name).read_bytes()).hexdigest()}  {name}\n")
    (folder / "SHA256SUMS").write_text("".join(lines))


@pytest.mark.icarus
@needs_icarus
def test_its_own_checks_pass_without_python(copy: Path) -> None:
    done = make(copy)
    assert done.returncode == 0, done.stdout + done.stderr
    passed = re.findall(r"^PASS (\w+): (\d+) results in all bits, latency (\d+), interval (\d+)", done.stdout, re.M)
    assert [unit for unit, *_ in passed] == UNITS
    for unit, count, latency, interval in passed:
        described = json.loads((copy / "rtl" / f"{unit}.json").read_text())
        assert (int(latency), int(interval)) == (described["latency"], described["initiation_interval"])
        assert int(count) >= 400
    assert done.stdout.endswith("all checks passed\n")


@pytest.mark.icarus
@needs_icarus
def test_behind_a_bus_its_own_checks_pass(tmp_path: Path) -> None:
    """With a prefix; and the same bytes again, PeakRDL's files too."""
    need_package("peakrdl_html", "pip install 'lightloom[registers]'")
    units = ["float_compare", "half_to_float"]
    for name in ("one", "two"):
        package_units(units, "tiny", None, tmp_path / name / "package", prefix="my_", bus="axi4-lite")
    files, again = (
        {path.relative_to(folder): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}
        for folder in (tmp_path / "one", tmp_path / "two")
    )
    assert files == again
    done = make(tmp_path / "one" / "package")
    assert done.returncode == 0, done.stdout + done.stderr
    passed = re.findall(r"^PASS (\w+): (\d+) results in all bits, through registers", done.stdout, re.M)
    assert passed == [(f"my_{unit}_axi4_lite", "200") for unit in units]
    readme = (tmp_path / "one" / "package" / "README.md").read_text()
    ties = re.search(r"Tie (.*) low", readme)
    assert ties
    assert {"`i__valid`", "`o__ready`", "`s_axi_awprot`"} <= set(re.findall(r"`\w+`", ties[1]))
    for module in (module for module, _ in passed):
        assert (tmp_path / "one" / "package" / "registers" / f"{module}_html" / "index.html").is_file()


@pytest.mark.icarus
@needs_icarus
def test_a_fault_behind_a_bus_is_heard(tmp_path: Path) -> None:
    need_package("peakrdl_html", "pip install 'lightloom[registers]'")
    folder = tmp_path / "package"
    package_units(["half_to_float"], "tiny", None, folder, bus="axi4-lite")
    verilog = folder / "rtl" / "half_to_float_axi4_lite.v"
    text = verilog.read_text()
    for old, new, message in (
        ("s_axi__bresp <= ", "s_axi__bresp <= 2'b00 & ", "a write is answered wrongly"),
        ("s_axi__rresp <= ", "s_axi__rresp <= 2'b00 & ", "a read is answered wrongly"),
        ("s_axi__rdata <= read_word", "s_axi__rdata <= read_word ^ 32'd2", "a wrong tag"),
    ):
        assert old in text
        verilog.write_text(text.replace(old, new))
        sign(folder)
        done = make(folder, "test-half_to_float_axi4_lite")
        assert done.returncode != 0
        assert f"FAIL half_to_float_axi4_lite: {message}" in done.stdout, old
        assert "PASS" not in done.stdout


def test_a_damaged_file_is_heard(copy: Path) -> None:
    for name in ("rtl/ray_time.v", "testbench/half_to_float.hex", "manifest.json", "sdc/float_compare.sdc"):
        whole = (copy / name).read_bytes()
        (copy / name).write_bytes(whole[:-2] + bytes([whole[-2] ^ 1]) + whole[-1:])
        done = make(copy, "checksums")
        assert done.returncode != 0
        assert f"{name}: FAILED" in done.stdout + done.stderr
        (copy / name).unlink()
        assert make(copy, "checksums").returncode != 0
        (copy / name).write_bytes(whole)
    assert make(copy, "checksums").returncode == 0


@pytest.mark.icarus
@needs_icarus
@pytest.mark.parametrize(
    ("name", "old", "new", "message"),
    [
        ("testbench/half_to_float.hex", "\n0", "\n1", "a wrong result"),
        ("rtl/half_to_float.v", "if (rst)", "if (1'b0)", "o__valid is unknown"),
        ("rtl/half_to_float.v", "assign i__ready = ", "assign i__ready = 1'b1 | ", "a waiting result changed"),
        ("testbench/half_to_float_tb.v", "LATENCY = 2", "LATENCY = 3", "the latency is not as stated"),
        ("testbench/half_to_float_tb.v", "INTERVAL = 1", "INTERVAL = 2", "the initiation interval is not as stated"),
    ],
    ids=["result", "reset", "stall", "latency", "interval"],
)
def test_a_fault_is_heard(copy: Path, name: str, old: str, new: str, message: str) -> None:
    text = (copy / name).read_text()
    assert old in text
    (copy / name).write_text(text.replace(old, new, 1))
    sign(copy)
    done = make(copy, "test-half_to_float")
    assert done.returncode != 0
    assert f"FAIL half_to_float: {message}" in done.stdout
    assert "PASS" not in done.stdout


def test_same_bytes_again(tiny: Path, tmp_path: Path) -> None:
    package_units(UNITS, "tiny", None, tmp_path / "again")
    files = sorted(path.relative_to(tiny) for path in tiny.rglob("*") if path.is_file())
    assert files == sorted(
        path.relative_to(tmp_path / "again") for path in (tmp_path / "again").rglob("*") if path.is_file()
    )
    for name in files:
        assert (tiny / name).read_bytes() == (tmp_path / "again" / name).read_bytes(), name


def test_manifest_and_checksums_name_every_file(tiny: Path) -> None:
    described = json.loads((tiny / "manifest.json").read_text())
    files = {str(path.relative_to(tiny)) for path in tiny.rglob("*") if path.is_file()} - {".lightloom"}
    assert set(described["files"]) == files - {"manifest.json", "SHA256SUMS"}
    for name, facts in described["files"].items():
        content = (tiny / name).read_bytes()
        assert facts == {"sha256": hashlib.sha256(content).hexdigest(), "bytes": len(content)}
    listed = {line.split("  ", 1)[1] for line in (tiny / "SHA256SUMS").read_text().splitlines()}
    assert listed == files - {"SHA256SUMS"}
    assert [unit["unit"] for unit in described["units"]] == UNITS
    assert (described["preset"], described["clock_ns"]) == ("tiny", CLOCKS["tiny"])


def test_no_path_of_this_machine(tiny: Path) -> None:
    root = str(ROOT)
    for path in tiny.rglob("*"):
        if path.is_file():
            assert root.encode() not in path.read_bytes(), path


def test_every_preset_has_a_clock() -> None:
    assert set(CLOCKS) == set(PRESETS)


@pytest.mark.parametrize("clock", [0.0, -1.0, float("nan"), 1e9])
def test_a_clock_that_cannot_be_meant(tmp_path: Path, clock: float) -> None:
    with pytest.raises(InputError, match=r"^--clock .*: a period in ns is 0.01 to 10000$"):
        package_units(UNITS, "tiny", clock, tmp_path / "out")
    assert list(tmp_path.iterdir()) == []


def test_a_failure_leaves_nothing(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"^no_unit: no such unit; choose from "):
        package_units(["float_compare", "no_unit"], "tiny", None, tmp_path / "out")

    def operands(unit: str) -> None:
        raise OSError(28, "No space left on device")

    with pytest.raises(InputError, match="No space left on device"):
        package(
            ["float_compare"],
            PRESETS["tiny"],
            "tiny",
            5.0,
            tmp_path / "out",
            operands=operands,  # type: ignore[arg-type]
            memory_model=Path(__file__),
        )
    assert list(tmp_path.iterdir()) == []


@pytest.mark.long
@pytest.mark.icarus
@needs_icarus
@pytest.mark.parametrize("preset", PRESETS)
def test_whole_package(tmp_path: Path, preset: str) -> None:
    package_units(list(CATALOGUE), preset, None, tmp_path / "package")
    done = make(tmp_path / "package")
    assert done.returncode == 0, done.stdout + done.stderr
    assert re.findall(r"^PASS (\w+):", done.stdout, re.M) == list(CATALOGUE)


@pytest.mark.long
@pytest.mark.icarus
@needs_icarus
def test_traversal_behind_a_bus(tmp_path: Path) -> None:
    need_package("peakrdl_html", "pip install 'lightloom[registers]'")
    package_units(["traversal"], "tiny", None, tmp_path / "package", bus="axi4-lite")
    done = make(tmp_path / "package")
    assert done.returncode == 0, done.stdout + done.stderr
    assert "PASS traversal_axi4_lite: 96 results in all bits, through registers" in done.stdout
