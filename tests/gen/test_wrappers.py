"""The wrappers of memories: every memory is in one, and macros may stand in for them."""

import functools
import json
import re
from collections.abc import Callable
from pathlib import Path

import pytest

from lightloom.gen.flow.synthesis import MEMORY
from lightloom.gen.wrappers import MODULE, split
from lightloom.golden_model.scene.files.load import load_scene
from lightloom.golden_model.stimuli.ray_families import RAY_FAMILIES
from lightloom.golden_model.tracing.wide_bvh.encode import build_wide
from lightloom.golden_model.tracing.wide_bvh.traversal import queries_of
from lightloom.rtl.catalogue import CATALOGUE
from lightloom.rtl.config import PRESETS
from lightloom.rtl.fabric.memory import READ_DURING_WRITE, Wrapper
from lightloom.sim.emitted import emitted as text_of
from lightloom.sim.run_traversal_bench import SMALL, run_traversal_bench
from lightloom.sim.traversal import TraversalRun, TraversalUnit
from tests.simulators import needs_icarus

SEED = 3300
WITH_MEMORIES = {"traversal"}

MACRO = """
// As the simulation models of RAM macros are: enables active low, and the word is garbage where it was just written.
module macro_model #(parameter WIDTH = 1, DEPTH = 2, ADDRESS = 1) (
  input clk, input wen_n, input [ADDRESS-1:0] wa, input [WIDTH-1:0] d,
  input ren_n, input [ADDRESS-1:0] ra, output reg [WIDTH-1:0] q
);
  reg [WIDTH-1:0] cells [0:DEPTH-1];
  always @(posedge clk) begin
    if (!wen_n) cells[wa] <= d;
    if (!ren_n) begin
      q <= cells[ra];
      if (!wen_n && wa == ra) begin
`ifdef VERILATOR
        q <= ~cells[ra];
`else
        q <= {WIDTH{1'bx}};
        $display("clash in %m");
`endif
      end
    end
  end
endmodule
"""


def macro(module: str, wrapper: Wrapper) -> str:
    """A module for a wrapper's place, with the macro inside."""
    address = (wrapper.depth - 1).bit_length()
    return f"""
module {module} (
  input clk, input w_en, input [{address - 1}:0] w_addr, input [{wrapper.width - 1}:0] w_data,
  input r_en, input [{address - 1}:0] r_addr, output [{wrapper.width - 1}:0] r_data
);
  macro_model #(.WIDTH({wrapper.width}), .DEPTH({wrapper.depth}), .ADDRESS({address})) macro (
    .clk(clk), .wen_n(~w_en), .wa(w_addr), .d(w_data), .ren_n(~r_en), .ra(r_addr), .q(r_data)
  );
endmodule
"""


def with_macros(verilog: str, during: str) -> str:
    """The text with macros in the place of all RAMs that say `during` of what a read sees in a write."""
    design, wrappers = split(verilog)
    texts = [design, MACRO]
    swapped = 0
    for module in MODULE.finditer(wrappers):
        wrapper = Wrapper.of(module[1])
        assert wrapper is not None
        swap = (wrapper.kind, wrapper.read_during_write) == ("ram", during)
        texts.append(macro(module[1], wrapper) if swap else "\n" + module[0])
        swapped += swap
    assert swapped
    return "".join(texts)


# --- what is emitted --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("preset", ["tiny", "base", pytest.param("full", marks=pytest.mark.long)])
def test_every_memory_is_in_a_wrapper(emitted: Callable[[str], Path], preset: str) -> None:
    for unit in CATALOGUE:
        assert not MEMORY.search((emitted(preset) / f"{unit}.v").read_text()), unit
        wrappers = emitted(preset) / f"{unit}_memories.v"
        assert wrappers.exists() == (unit in WITH_MEMORIES)
        if wrappers.exists():
            text = wrappers.read_text()
            modules = list(MODULE.finditer(text))
            assert len(modules) == text.count("endmodule")
            assert all(len(MEMORY.findall(module[0])) == 1 for module in modules)


@pytest.mark.parametrize("unit", CATALOGUE)
def test_the_manifest_lists_them(base: Path, unit: str) -> None:
    listed = json.loads((base / f"{unit}.json").read_text())["memories"]
    if unit not in WITH_MEMORIES:
        assert listed is None
        return
    design, wrappers = (base / f"{unit}.v").read_text(), (base / listed["file"]).read_text()
    assert [each["module"] for each in listed["wrappers"]] == re.findall(r"^module (\w+)", wrappers, re.M)
    for each in listed["wrappers"]:
        (module,) = (found for found in MODULE.finditer(wrappers) if found[1] == each["module"])
        text = module[0]
        assert f"  reg [{each['width'] - 1}:0] words [{each['depth'] - 1}:0];" in text
        assert len(re.findall(r"^  output ", text, re.M)) == each["reads"]
        assert ("posedge clk" in text.split("if (w_en)")[1]) == (each["kind"] == "ram")
        assert ("(* no_rw_check" in text) == (each["read_during_write"] == "any")
        said = " ".join(line.removeprefix("// ") for line in text.splitlines() if line.startswith("//"))
        assert READ_DURING_WRITE[each["read_during_write"]] in said
        assert each["instances"] == len(re.findall(rf"^  {each['module']} \S+ \($", design, re.M)) > 0


def test_nothing_else_has_changed(base: Path) -> None:
    """Without its wrappers the text is what it was, module by module."""
    whole = text_of("traversal", PRESETS["base"])
    design, wrappers = split(whole)
    assert sorted((design + wrappers).split()) == sorted(whole.split())
    assert not split(design)[1]


# --- macros in their place --------------------------------------------------------------------------------------------


@functools.cache
def traced(during: str | None) -> TraversalRun:
    """What a small unit answers, with macros in the place of what says `during`."""
    verilog = text_of("traversal", SMALL)
    verilog = verilog if during is None else with_macros(verilog, during)
    triangles = load_scene("cornell-box").triangles
    tree = build_wide(triangles, width=SMALL.tree.width, max_levels=SMALL.traversal.stack)
    rays = RAY_FAMILIES["adversarial"](triangles, 4000, SEED)
    unit = TraversalUnit(SMALL, memory_bits=20, verilog=verilog, level=0)
    return unit.run(tree.blocks, queries_of(rays), latency=30, reorder=100, memory_stall=40, stall_seed=SEED)


def test_macros_on_verilator() -> None:
    """The same results in the same cycles."""
    own, swapped = traced(None), traced("any")
    assert own.results.tobytes() == swapped.results.tobytes(), f"seed {SEED}"
    assert own.counters == swapped.counters


def test_a_macro_that_is_not_what_was_asked_for() -> None:
    """Where a read has to see the old word, garbage is noticed."""
    own, swapped = traced(None), traced("old")
    assert own.results.tobytes() != swapped.results.tobytes()


@pytest.mark.long
@pytest.mark.icarus
@needs_icarus
def test_macros_on_icarus(tmp_path: Path) -> None:
    """What is read while it is written is unknown there, and does not get anywhere."""
    verilog = with_macros(text_of("traversal", SMALL), "any")
    only = "stalled/run=5|another_tree_while"
    assert run_traversal_bench(tmp_path, "icarus", SMALL, rays=400, few=10, verilog=verilog, only=only) > 0
    clashes = set(re.findall(r"clash in \S+\.(\w+)\.macro", (tmp_path / "log.txt").read_text()))
    assert {"nearest_ahead", "primitives_ahead"} <= clashes
