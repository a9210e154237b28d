"""The page docs/command-line.md, made from the commands' own help: `python -m lightloom.pages.command_line`.

And the table of the hardware's parameters in docs/emission.md: `python -m lightloom.pages.command_line parameters`.
"""

import sys
from typing import Any

from typer.main import get_command

from lightloom.cli import app
from lightloom.rtl.config import PARAMETERS, PLACES, PRESETS

WIDTH = 100

PREAMBLE = """\
# Command line

<!-- Made by `python -m lightloom.pages.command_line > docs/command-line.md`; a test holds it to the program. -->

`make` puts the command into `.venv/bin/lightloom`. What holds for all commands:

- **Tables and JSON** go to stdout, progress and errors to stderr. With `--json` there is nothing but JSON on stdout.
- **Outputs appear whole or not at all.** Folders are replaced only if Lightloom wrote them; others are refused.
- **The same options give the same bits**, on any machine: frames as EXR, lightmaps, hits, irradiance, Verilog.
  (8-bit pictures are for the eye and may differ by one step; charts of curved meshes depend on the build of xatlas.)
- **Exit codes**: 0 done; 1 a comparison found a difference; 2 bad input, said in one line that begins with `error:`;
  130 interrupted; 70 a fault of Lightloom's own, with a traceback.
- **What is left out of the input**, or changed, is said on stderr in a line that begins with `warning:`; the exit code
  stays 0.

Array files are NumPy's `.npz`: N rays or points, float32 unless said otherwise.

| file | arrays |
|---|---|
| rays, for `trace` | `origin` (N,3), `direction` (N,3), `t_min` (N), `t_max` (N) |
| hits, from `trace` | `primitive` (N) int32, -1 a miss; `t`, `u`, `v` (N) |
| points, for `irradiance` | `position` (N,3), `normal` (N,3), of any length |
| irradiance, from `irradiance` | `irradiance` (N,3), RGB |
"""


def page() -> str:
    """The whole page."""
    group: Any = get_command(app)
    top = group.make_context("lightloom", [], resilient_parsing=True, terminal_width=WIDTH)
    parts = [PREAMBLE, _help(top)]
    for name, command in group.commands.items():
        context = command.make_context(name, [], parent=top, resilient_parsing=True)
        parts += [f"\n## lightloom {name}\n", _help(context)]
    return "\n".join(parts)


def _help(context: Any) -> str:
    return f"```\n$ {context.command_path} --help\n{context.get_help()}\n```"


def parameters() -> str:
    """Every field of the hardware's configuration: what it may be, what it is in each preset, what it is for."""
    rows = [["parameter", "of `Config`", "may be", *PRESETS, "is"], ["---"] * (4 + len(PRESETS))]
    for name, each in PARAMETERS.items():
        values = [str(config.flat()[name]) for config in PRESETS.values()]
        rows.append([f"`{name}`", f"`{'.'.join(PLACES[name])}`", each.allowed, *values, each.says])
    return "\n".join("| " + " | ".join(row) + " |" for row in rows)


if __name__ == "__main__":
    sys.stdout.write((parameters() if sys.argv[1:] == ["parameters"] else page()) + "\n")
