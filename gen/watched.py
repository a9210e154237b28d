"""For simulations: a Verilog module and, beside its memory port, the checker of AXI4's rules."""

import re
from collections.abc import Mapping
from functools import cache
from typing import Any, NamedTuple

from lightloom.gen.verilog import AXI, convert
from lightloom.golden_model.contract.axi_rules import RULE_PORTS
from lightloom.rtl.memory.axi import Axi, AxiPort, AxiRead, AxiWrite
from lightloom.rtl.memory.axi_checker import RULE_BITS, AxiChecker

PORT = re.compile(r"^  (input|output) (?:\[(\d+):0\] )?(\w+);", re.MULTILINE)


class Port(NamedTuple):
    """A port of a Verilog module."""

    direction: str
    width: int


def ports_of(verilog: str, module: str) -> dict[str, Port]:
    """The ports of a module, from its text as Yosys writes it."""
    start = re.search(rf"^module {module}\(", verilog, re.MULTILINE)
    assert start is not None, f"no module {module}"
    text = verilog[start.start() : verilog.index("endmodule", start.start())]
    return {name: Port(direction, int(high or 0) + 1) for direction, high, name in PORT.findall(text)}


def axi_of(ports: Mapping[str, Port], prefix: str) -> AxiPort | Axi:
    """The AXI4 port whose signals have the names that begin with `prefix`."""
    reads, writes = (f"{prefix}{name}" in ports for name in ("arvalid", "awvalid"))
    address, data = ("ar", "r") if reads else ("aw", "w")
    widths = {
        "address_width": ports[f"{prefix}{address}addr"].width,
        "data_width": ports[f"{prefix}{data}data"].width,
        "id_width": ports[f"{prefix}{address}id"].width,
    }
    if reads and writes:
        return Axi(**widths)
    return AxiRead(**widths) if reads else AxiWrite(**widths)


def watched(module: str, ports: Mapping[str, Port], *, prefix: str = f"{AXI}_", **limits: Any) -> str:
    """The Verilog of `<module>_watched`: the module with all of its ports, and the checker, `axi_checker`, beside the
    one whose signals begin with `prefix`. Its outputs are RULE_PORTS; `axi_forget` resets it alone. `limits` are
    parameters of the checker. Nothing of it is counted in coverage.
    """
    declared = [f"  {port.direction} wire [{port.width - 1}:0] {name}" for name, port in ports.items()]
    declared += [f"  output wire [{RULE_BITS - 1}:0] {name}" for name in RULE_PORTS]
    inner = [f"    .{name}({name})" for name in ports]
    watching = [f"    .{AXI}_{name}({prefix}{name})" for port in axi_of(ports, prefix).ports for name in port.members]
    watching += ["    .broken()", *(f"    .{name.removeprefix('axi_')}({name})" for name in RULE_PORTS)]
    return "\n".join(
        [
            "// verilator coverage_off",
            f"module {module}_watched (",
            ",\n".join([*declared, "  input wire axi_forget"]),
            ");",
            f"  {module} unit (",
            ",\n".join(inner),
            "  );",
            "  axi_checker watcher (",
            ",\n".join(["    .clk(clk)", "    .rst(rst | axi_forget)", *watching]),
            "  );",
            "endmodule",
            "",
            checker(frozenset(ports.items()), prefix, **limits),
        ]
    )


@cache
def checker(ports: frozenset[tuple[str, Port]], prefix: str, **limits: Any) -> str:
    """The Verilog of the checker of an AXI4 port, module `axi_checker`; the rest as for `watched`."""
    return convert(AxiChecker(axi_of(dict(ports), prefix), **limits), "axi_checker")
