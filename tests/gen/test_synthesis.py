"""Synthesis on small designs: counts, names, memories, timing."""

import shutil
import subprocess
from collections import Counter
from pathlib import Path
from typing import Any

import pytest

from lightloom.gen.flow import fanout, fpga, libraries, macros, memories, synthesis, timing, tools
from lightloom.gen.flow.memories import Memory
from lightloom.golden_model.host.errors import InputError
from tests.needs import needs
from tests.simulators import needs_icarus

TWELVE = Path(__file__).with_name("twelve.lib")

needs_sta = needs(tools.path_of(timing.PROGRAM) is not None, "OpenSTA is missing: apt install opensta", optional=True)

ADDER = """
module half(clk, en, a, b, s);
  input clk, en, a, b;
  output s;
  reg s;
  always @(posedge clk) if (en) s <= a ^ b;
endmodule

module pair(clk, rst, en, a, b, s);
  input clk, rst, en;
  input [1:0] a, b;
  output [1:0] s;
  reg seen;
  always @(posedge clk) if (rst) seen <= 1'b0; else seen <= 1'b1;
  wire on = en & seen;
  half low (.clk(clk), .en(on), .a(a[0]), .b(b[0]), .s(s[0]));
  half high (.clk(clk), .en(on), .a(a[1]), .b(b[1]), .s(s[1]));
endmodule
"""

# One memory with two synchronous reads, of which the first shows what is written in its cycle.
RAM = """
module ram(clk, we, wa, wd, re, ra, rb, qa, qb);
  input clk, we, re;
  input [3:0] wa, ra, rb;
  input [7:0] wd;
  output [7:0] qa, qb;
  reg [7:0] words [0:15];
  reg [7:0] qa, qb;
  always @(posedge clk) begin
    if (we) words[wa] <= wd;
    if (re) qa <= we && wa == ra ? wd : words[ra];
    qb <= words[rb];
  end
endmodule
"""


def twelve(folder: Path) -> libraries.Library:
    return libraries.unpack("twelve", [TWELVE], libraries.PERIOD, folder)


def test_gates_are_counted_with_and_without_flip_flops(tmp_path: Path) -> None:
    found = synthesis.elaborate(ADDER, "pair", tmp_path, 256)
    gates = synthesis.count(ADDER, "pair", tmp_path, 256)
    assert found.flip_flops == 3
    assert found.memories == ()
    # An exclusive or is four NANDs; a flip-flop is four gates, its enable a multiplexer besides.
    assert 2 * 3 <= gates.logic <= 2 * 4 + 1
    assert gates.everything >= gates.logic + 3 * 4
    assert synthesis.Elaborated.from_json(found.as_json()) == found


def test_parts_are_modules_with_their_instances(tmp_path: Path) -> None:
    parts = {part.module: part for part in synthesis.parts(ADDER, "pair", tmp_path, 256)}
    assert {name: part.instances for name, part in parts.items()} == {"pair": 1, "half": 2}
    assert parts["half"].gates >= 4 + 4


@needs_sta
def test_a_path_is_told_in_the_names_of_the_verilog(tmp_path: Path) -> None:
    elaborated = tmp_path / "elaborated"
    elaborated.mkdir()
    synthesis.elaborate(ADDER, "pair", elaborated, 256)
    library = twelve(tmp_path)
    mapped = synthesis.mapped(tmp_path, elaborated, library, "pair")
    assert mapped.cells > 3
    assert mapped.area > mapped.flip_flop_area == 3 * 6
    found = timing.analyse(tmp_path, library, "pair", 5)
    assert found.end in ("low.s", "high.s", "seen")
    assert 0 < 5 - found.slack < 5
    assert found.fmax == pytest.approx(1000 / (5 - found.slack))


MANY = """
module many(clk, a, b, y);
  input clk, a;
  input [299:0] b;
  output [299:0] y;
  reg r;
  reg [299:0] y;
  always @(posedge clk) begin r <= a; y <= b & {300{r}}; end
endmodule
"""


def test_what_a_flip_flop_drives_is_buffered(tmp_path: Path) -> None:
    elaborated = tmp_path / "elaborated"
    elaborated.mkdir()
    synthesis.elaborate(MANY, "many", elaborated, 256)
    found = synthesis.mapped(tmp_path, elaborated, twelve(tmp_path), "many")
    netlist = (tmp_path / "mapped.v").read_text()
    # 300 gates behind 19 buffers of 16 cells each, those behind two.
    assert netlist.count("BUF ") >= 19 + 2
    assert found.cells == 301 + 300 + netlist.count("BUF ")


@pytest.mark.parametrize("count", [32, 33, 100, 1000])
def test_trees_on_large_nets(count: int) -> None:
    """All that a net drove it still drives, through buffers only, and nothing drives too much."""

    def gate(taken: int, made: int) -> dict[str, Any]:
        ways = {"A": "input", "Y": "output"}
        return {"type": "INV", "port_directions": ways, "connections": {"A": [taken], "Y": [made]}}

    cells = {"root": gate(2, 3), **{f"leaf{index}": gate(3, 4 + index) for index in range(count)}}
    module: dict[str, Any] = {"cells": cells, "netnames": {}, "ports": {}}
    added = fanout.spread({"modules": {"top": module}}, "top", [fanout.Buffer("BUF", 1, "A", "Y", 1, 1000)])
    assert (added == 0) == (count <= fanout.LARGE)
    driver = {cell["connections"]["Y"][0]: name for name, cell in cells.items()}
    driven = Counter(cell["connections"]["A"][0] for cell in cells.values())
    assert max(driven.values()) <= (fanout.LIMIT if added else count)
    for index in range(count):
        name = f"leaf{index}"
        while name != "root":
            name = driver[cells[name]["connections"]["A"][0]]
            assert name == "root" or cells[name]["type"] == "BUF"


REPORT = """\
tns -1.5000
Startpoint: core.a[3]_reg (rising edge-triggered flip-flop clocked by clk)
Endpoint: o__valid_reg (rising edge-triggered flip-flop clocked by clk)
   0.0194    0.0548    0.1000    0.1000 ^ core.a[3]_reg/Q (DFF)
   0.0194    0.0548    0.0456    0.1456 v _2561_/Y (INV)
             0.0000    0.0002    0.1458 v o__valid_reg/D (DFF)
             -0.5000   slack (VIOLATED)
"""


def test_report_of_the_timing() -> None:
    found = timing.parse(REPORT, 2.0)
    assert (found.start, found.end, found.cells) == ("core.a[3]", "o__valid", 2)
    assert (found.slack, found.total_negative_slack, found.fmax) == (-0.5, -1.5, 400)


@pytest.mark.parametrize("text", ["", "Error: 12 cells.lib not found\n" + REPORT])
def test_report_that_cannot_be_used(text: str) -> None:
    with pytest.raises(InputError, match="sta: "):
        timing.parse(text, 2.0)


def test_memory_is_kept_out(tmp_path: Path) -> None:
    found = synthesis.elaborate(RAM, "ram", tmp_path, 128)
    (memory,) = found.memories
    assert (memory.depth, memory.width, memory.reads, memory.writes, memory.bits) == (16, 8, 2, 1, 128)
    assert memory.name == "words"
    # What is left is the bypass of the first port: the word and a bit for each of its bits.
    assert 8 < found.flip_flops <= 16 + 1


def test_small_memory_becomes_flip_flops(tmp_path: Path) -> None:
    found = synthesis.elaborate(RAM, "ram", tmp_path, 129)
    assert found.memories == ()
    assert found.flip_flops >= 128 + 16


MODEL = """
module NAME(clk, r0_en, r0_addr, r0_data, r1_en, r1_addr, r1_data, w0_en, w0_addr, w0_data);
  input clk, r0_en, r1_en;
  input [3:0] r0_addr, r1_addr, w0_addr;
  input [ENABLES-1:0] w0_en;
  input [7:0] w0_data;
  output [7:0] r0_data, r1_data;
  reg [7:0] r0_data, r1_data;
  reg [7:0] words [0:15];
  wire [7:0] mask = {8/ENABLES{w0_en}};
  always @(posedge clk) begin
    words[w0_addr] <= (w0_data & mask) | (words[w0_addr] & ~mask);
    if (r0_en) r0_data <= words[r0_addr];
    if (r1_en) r1_data <= words[r1_addr];
  end
endmodule
"""
MASKED = "begin words[wa][3:0] <= wd[3:0]; if (wd[0]) words[wa][7:4] <= wd[7:4]; end"
BENCH = """
module bench;
  reg clk = 0, we = 1, re = 1;
  reg [3:0] wa = 0, ra = 0, rb = 0;
  reg [7:0] wd = 0;
  wire [7:0] qa0, qb0, qa1, qb1;
  integer k, seed = 5, wrong = 0, same = 0;
  original one (.clk(clk), .we(we), .wa(wa), .wd(wd), .re(re), .ra(ra), .rb(rb), .qa(qa0), .qb(qb0));
  ram other (.clk(clk), .we(we), .wa(wa), .wd(wd), .re(re), .ra(ra), .rb(rb), .qa(qa1), .qb(qb1));
  initial begin
    for (k = 0; k < 2000; k = k + 1) begin
      wa = k < 16 ? k : $random(seed); wd = $random(seed); ra = $random(seed); rb = $random(seed);
      we = k < 16 | $random(seed); re = $random(seed);
      #1 clk = 1;
      if (we & re & wa == ra) same = same + 1;
      #1 clk = 0;
      if (k > 32 && (qa0 !== qa1 || qb0 !== qb1)) wrong = wrong + 1;
    end
    $display("wrong %0d, same %0d", wrong, same > 20);
  end
endmodule
"""


@needs_icarus
@pytest.mark.parametrize("masked", [False, True], ids=["words", "parts of words"])
def test_memory_and_bypass_do_what_the_verilog_says(masked: bool, tmp_path: Path) -> None:
    ram = RAM
    if masked:  # without a bypass: Yosys sees none around writes of parts
        ram = RAM.replace("words[wa] <= wd;", MASKED).replace("we && wa == ra ? wd : words[ra]", "words[ra]")
    (memory,) = synthesis.elaborate(ram, "ram", tmp_path, 128).memories
    assert memory.masked == masked
    model = MODEL.replace("NAME", memory.macro).replace("ENABLES", "8" if masked else "1")
    tools.yosys("read_rtlil gates.il\nwrite_verilog -noattr gates.v\n", tmp_path)
    (tmp_path / "model.v").write_text(model + ram.replace("module ram(", "module original(") + BENCH)
    command = ["iverilog", "-g2001", "-s", "bench", "-o", "bench.vvp", "gates.v", "model.v"]
    subprocess.run(command, cwd=tmp_path, check=True)
    done = subprocess.run(["vvp", "-n", "bench.vvp"], cwd=tmp_path, check=True, capture_output=True, text=True)
    assert done.stdout.strip() == "wrong 0, same 1"


@needs_sta
def test_access_time_of_a_memory_counts(tmp_path: Path) -> None:
    elaborated = tmp_path / "elaborated"
    elaborated.mkdir()
    found = synthesis.elaborate(RAM, "ram", elaborated, 128)
    library = twelve(tmp_path)
    synthesis.mapped(tmp_path, elaborated, library, "ram")
    slacks = []
    for access in (0.5, 3.0):
        (tmp_path / "memories.lib").write_text(memories.liberty(found.memories, access, 0.1))
        slacks.append(timing.analyse(tmp_path, library, "ram", 5, "memories.lib").slack)
    assert slacks[0] > slacks[1]
    assert slacks[1] < 2


ACCESS = 'timing () { cell_rise (shape) { values ("0.5,1.25", \\\n "0.75,2.5"); } }'


def test_macros_are_tiled_with_the_least_area(tmp_path: Path) -> None:
    paths = []
    for name, address, width, area, access in (("small", 4, 8, 10, ""), ("large", 8, 16, 90, ACCESS)):
        paths.append(tmp_path / f"{name}.lib")
        memory = f"memory () {{\naddress_width : {address};\nword_width : {width};\n}}\n"
        paths[-1].write_text(f"library (x) {{\ncell ({name}) {{\n{memory}area : {area};\n{access}}}\n}}\n")
    known = macros.read_macros(paths)
    assert [(macro.name, macro.depth, macro.width, macro.area, macro.access) for macro in known] == [
        ("small", 16, 8, 10, None),
        ("large", 256, 16, 90, 2.5),
    ]
    # Two copies for the reads, and each is read and written in one cycle.
    tiling = macros.tile(Memory("top", "m", 40, 9, 2, 1), known)
    assert tiling.macro is not None
    assert (tiling.macro.name, tiling.count, tiling.area) == ("small", 3 * 2 * 2 * 2, 240)
    assert tiling.filled == 40 * 9 / (6 * 16 * 8)
    large = macros.tile(Memory("top", "m", 256, 16, 1, 1), known).macro
    assert large is not None
    assert large.name == "large"
    # With flip-flops of this size, a small memory is smaller in them, a large one is not.
    few, many = (macros.tile(Memory("top", "m", depth, 8, 1, 1), known, 0.1) for depth in (4, 16))
    assert (few.macro, few.count, few.area, few.filled) == (None, 0, 2 * 32 * 0.1, None)
    assert many.macro is not None
    with pytest.raises(InputError, match=r"twelve\.lib: describes no memory"):
        macros.read_macros([TWELVE])


def test_pdk_by_name(tmp_path: Path) -> None:
    import gzip

    folder = tmp_path / "ihp-sg13g2" / "lib"
    folder.mkdir(parents=True)
    (folder / "sg13g2_stdcell_typ_1p20V_25C.lib.gz").write_bytes(gzip.compress(TWELVE.read_bytes()))
    name, files, period = libraries.of_pdk("ihp-sg13g2", tmp_path, "typ")
    assert (name, period) == ("ihp-sg13g2 typ", 5)
    library = libraries.unpack(name, files, period, tmp_path)
    assert library.file_names == ["sg13g2_stdcell_typ_1p20V_25C.lib"]
    assert library.files[0].read_bytes() == TWELVE.read_bytes()
    assert [buffer.cell for buffer in fanout.buffers(library)] == ["BUF"]
    assert libraries.sequential(library) == libraries.combinational(library) == library.file_names
    with pytest.raises(InputError, match="holds no sg13g2_stdcell_slow"):
        libraries.of_pdk("ihp-sg13g2", tmp_path, "slow")
    with pytest.raises(InputError, match="--corner fast: ihp-sg13g2 has typ and slow"):
        libraries.of_pdk("ihp-sg13g2", tmp_path, "fast")


def test_wrapper_joins_every_port(tmp_path: Path) -> None:
    ports = [("clk", "input", 1), ("rst", "input", 1), ("en", "input", 1), ("a", "input", 2), ("b", "input", 2)]
    text = fpga.wrapper("pair", [*ports, ("s", "output", 2)])
    assert text.count(".") == 6
    (tmp_path / "unit.v").write_text(ADDER)
    (tmp_path / "wrapper.v").write_text(text)
    log = tools.yosys(f"read_verilog unit.v wrapper.v\nhierarchy -check -top {fpga.WRAPPER}\nproc\ncheck\n", tmp_path)
    assert "Found and reported 0 problems" in log
    assert "Warning" not in log.replace("Warnings", "")


@pytest.mark.long
def test_unit_on_a_device(tmp_path: Path) -> None:
    ports = [("clk", "input", 1), ("rst", "input", 1), ("en", "input", 1), ("a", "input", 2), ("b", "input", 2)]
    placed = fpga.place(ADDER, "pair", [*ports, ("s", "output", 2)], "25k", tmp_path)
    assert placed.fits
    assert placed.fmax is not None
    assert placed.used["flip_flops"] == 3 + placed.wrapper_flip_flops
    assert shutil.which("yowasp-ecppack") is None or (tmp_path / fpga.BITSTREAM).stat().st_size > 100_000
