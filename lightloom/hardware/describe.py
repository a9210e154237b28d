"""Emits units into a folder and describes them in rows ready for JSON."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from lightloom.golden_model.contract import bitpack
from lightloom.rtl.catalogue import CATALOGUE
from lightloom.rtl.config import PRESETS


def unit_row(unit: str, preset: str) -> dict[str, Any]:
    """Name, what it computes, latency and initiation interval in clock cycles, bits of the payloads without the tag.

    Latency and interval are None where they depend on the scene and the memory.
    """
    component = CATALOGUE[unit](PRESETS[preset])
    description = component.unit
    return {
        "unit": unit,
        "summary": description.summary,
        "latency": component.latency,
        "initiation_interval": component.initiation_interval,
        "input_bits": bitpack.width(description.input),
        "output_bits": bitpack.width(description.output),
    }


def emit_units(
    units: Sequence[str],
    preset: str,
    out: Path,
    advance: Callable[[float], None] = lambda steps: None,
    prefix: str = "",
    bus: str = "",
) -> list[dict[str, Any]]:
    """Writes Verilog and manifests of units into `out`, whole or not at all; returns the units' rows."""
    from lightloom.gen.emit import emit

    emit(units, PRESETS[preset], preset, out, prefix=prefix, bus=bus, progress=lambda unit: advance(1))
    return [unit_row(unit, preset) for unit in units]
