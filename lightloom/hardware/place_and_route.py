"""The layout of one small unit: placed, routed, merged with its cells, compared with its netlist, drawn."""

import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

from lightloom.golden_model.host.errors import InputError
from lightloom.golden_model.host.outputs import whole_folder
from lightloom.rtl.config import PRESETS
from lightloom.shared.provenance import COMMIT

PIXELS = 1400
DETAIL = 24.0
"""Micrometres of the middle that the second picture shows."""
KEPT = ("{}_mapped.v", "{}_routed.def", "{}.gds")


def lay_out(
    unit: str, preset: str, pdk_root: Path, out: Path, seed: int, progress: Callable[[str], None] = lambda step: None
) -> dict[str, Any]:
    """Writes netlist, DEF, GDS, two pictures and `layout.json` into `out`, whole or not at all; returns the figures.

    Raises InputError where a tool or a file of the PDK is missing or a tool fails, and where the metal of the layout
    does not connect what the netlist does.
    """
    from lightloom.gen.flow import layout, layout_check
    from lightloom.shared.console import json_text
    from lightloom.sim.emitted import emitted

    with whole_folder(out) as folder, tempfile.TemporaryDirectory(prefix="lightloom-layout-") as name:
        scratch = Path(name)
        routed = layout.place_and_route(
            emitted(unit, PRESETS[preset]), unit, pdk_root, scratch, seed=seed, progress=progress
        )
        progress("connections")
        merged = layout_check.merge(scratch, unit)
        found, wanted = layout_check.connections(merged, scratch), layout_check.wanted(scratch, unit)
        report = {
            "command": f"lightloom layout {unit} --preset {preset} --pdk-root $PDK_ROOT --seed {seed}",
            "versions": {**COMMIT, **layout.versions()},
            "rows": [
                {
                    "unit": unit,
                    "preset": preset,
                    **routed.as_json(),
                    "nets_as_in_netlist": len(found & wanted),
                    "nets_of_netlist": len(wanted),
                    "nets_not_in_netlist": len(found - wanted),
                    **{f"{rule}_violations": count for rule, count in layout_check.violations(merged).items()},
                }
            ],
        }
        x, y, half = routed.width / 2, routed.height / 2, DETAIL / 2
        detail = (x - half, y - half, x + half, y + half)
        layout_check.draw(scratch, unit, folder / f"{unit}.png", pixels=PIXELS)
        layout_check.draw(scratch, unit, folder / f"{unit}-detail.png", pixels=PIXELS, box=detail)
        for pattern in KEPT:
            shutil.copy(scratch / pattern.format(unit), folder)
        (folder / "layout.json").write_text(json_text(report), encoding="utf-8")
        if routed.unrouted or found != wanted:
            raise InputError(
                f"{unit}: {routed.unrouted} nets not routed, {len(wanted - found)} of {len(wanted)} not as in the "
                "netlist; choose another --seed or a smaller unit"
            )
    return report
