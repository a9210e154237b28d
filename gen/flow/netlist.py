"""A mapped netlist as Verilog that any simulator takes: its cells become what their liberty files say they do."""

from pathlib import Path

from lightloom.gen.flow import tools
from lightloom.gen.flow.libraries import Library

SCRIPT = """
read_verilog mapped.v
{liberties}
hierarchy -check -top {top}
flatten
opt_clean -purge
write_verilog -noattr simulated.v
"""


def simulated(folder: Path, library: Library, top: str) -> str:
    """The text of mapped.v in `folder` with every cell replaced by its function; the library's files are there too.

    One module, with the ports of the unit. Raises InputError where a cell has no function.
    """
    liberties = "\n".join(f"read_liberty -ignore_miss_func {name}" for name in library.file_names)
    tools.yosys(SCRIPT.format(liberties=liberties, top=top), folder, "simulated")
    return (folder / "simulated.v").read_text(encoding="utf-8")
