"""Static timing of a mapped netlist with OpenSTA: the slowest path, and the clock that it allows.

Wires have no length yet, the clock is ideal, and what is outside of the unit takes no time: inputs change with the
clock, and outputs are as good as registers. A memory's word is there after a given part of the period.
"""

import re
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from lightloom.gen.flow import tools
from lightloom.gen.flow.libraries import Library
from lightloom.golden_model.host.errors import InputError

PROGRAM = "sta"
REPORT = "timing.txt"

SCRIPT = """\
{liberties}
read_verilog mapped.v
link_design {top}
set_cmd_units -time ns
create_clock -name clk -period {period} [get_ports clk]
set inputs [list]
foreach port [all_inputs] {{ if {{ [get_full_name $port] != "clk" }} {{ lappend inputs $port }} }}
set_input_delay 0 -clock clk $inputs
set_output_delay 0 -clock clk [all_outputs]
report_tns -digits 4
report_checks -path_delay max -fields {{slew cap fanout}} -digits 4
"""

CELL = re.compile(r"^[ \d.-]*\s(-?\d+\.\d+)\s+(-?\d+\.\d+) [v^] (\S+)/(\S+) \((\S+)\)$", re.MULTILINE)
"""Delay, time, instance, pin and cell of a line of a path."""


@dataclass(frozen=True)
class Timing:
    """The slowest path; times in ns."""

    period: float
    slack: float
    total_negative_slack: float
    start: str
    """The register, memory or port where the path begins, by its name in the unit's Verilog."""
    end: str
    cells: int
    """Cells on the path, that of the register it starts from among them."""

    @property
    def fmax(self) -> float:
        """Clock frequency in MHz at which the path would just fit."""
        return 1000 / (self.period - self.slack)

    def as_json(self) -> dict[str, Any]:
        return asdict(self)


def analyse(folder: Path, library: Library, top: str, period: float, memories: str | None = None) -> Timing:
    """The timing of mapped.v in `folder` at a clock of `period` ns; OpenSTA's report is kept there as timing.txt.

    `memories` is the name of the liberty file of what was kept out of the mapping. Raises InputError where OpenSTA is
    missing or refuses a file.
    """
    names = [*library.file_names, *([memories] if memories else [])]
    liberties = "\n".join(f"read_liberty {name}" for name in names)
    (folder / "timing.tcl").write_text(SCRIPT.format(liberties=liberties, top=top, period=period))
    report = tools.run(PROGRAM, "-no_splash", "-exit", "timing.tcl", folder=folder)
    (folder / REPORT).write_text(report, encoding="utf-8")
    return parse(report, period)


def parse(report: str, period: float) -> Timing:
    """The slowest path of OpenSTA's report."""
    # It goes on after an error, and ends with 0.
    error = re.search(r"^Error:? .*$", report, re.MULTILINE)
    slack = re.search(r"(-?\d+\.\d+)\s+slack", report)
    ends = re.findall(r"^(?:Startpoint|Endpoint): (\S+)", report, re.MULTILINE)
    total = re.search(r"^tns (?:max )?(-?\d+\.\d+)", report, re.MULTILINE)
    if error or slack is None or total is None or len(ends) != 2:
        raise InputError(f"{PROGRAM}: {error.group() if error else 'found no path from register to register'}")
    start, end = (name.removesuffix("_reg") for name in ends)
    instances = {instance for _, _, instance, _, _ in CELL.findall(report)}
    return Timing(period, float(slack.group(1)), float(total.group(1)), start, end, len(instances - {ends[1]}))
