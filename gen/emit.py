"""Writes units as Verilog with their manifests into one folder."""

import difflib
import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from lightloom.gen.header import checked_prefix, header
from lightloom.gen.manifest import manifest
from lightloom.gen.verilog import verilog_of
from lightloom.gen.wrappers import memories_file, split
from lightloom.golden_model.contract.interfaces import UNITS
from lightloom.golden_model.host.errors import InputError
from lightloom.golden_model.host.outputs import whole_folder
from lightloom.rtl.buses import module_name
from lightloom.rtl.catalogue import CATALOGUE
from lightloom.rtl.config import Config

INDEXED = ("unit", "module", "summary", "file", "sha256", "latency", "initiation_interval")
"""The keys of a unit's manifest that the folder's index, manifest.json, repeats."""


def emit(
    units: Sequence[str] | None,
    config: Config,
    preset: str | None,
    out: Path | str,
    *,
    prefix: str = "",
    bus: str = "",
    progress: Callable[[str], None] = lambda unit: None,
) -> list[dict[str, Any]]:
    """Writes <module>.v and <module>.json of each unit (none named: of all) and manifest.json into `out`.

    The wrappers of a unit's memories are in a file of their own, <module>_memories.v.

    A module is called `prefix` and the unit's name; so are the modules inside it, so that the same unit with two
    configurations can be in one design. With a `bus`, units stand behind that, and its name follows theirs.

    The folder appears whole or not at all; the same units and configuration give the same bytes. `preset` is the
    name of `config`, for the manifests. `progress` is told of every unit done. Returns the manifests. Raises
    InputError for an unknown unit and for a folder that cannot be written.
    """
    checked_prefix(prefix)
    names = list(dict.fromkeys(units or CATALOGUE))
    for unit in names:
        if unit not in CATALOGUE:
            close = difflib.get_close_matches(unit, CATALOGUE, n=3, cutoff=0.5)
            others = [name for name in CATALOGUE if name not in close]
            raise InputError(f"{unit}: no such unit; choose from {', '.join([*close, *others])}")
    manifests = []
    with whole_folder(out) as folder:
        for unit in names:
            module = prefix + module_name(unit, bus)
            verilog, wrappers = split(verilog_of(unit, config, prefix, bus))
            verilog = header(f"{module}: {UNITS[unit].summary}", config, preset, verilog) + verilog
            (folder / f"{module}.v").write_text(verilog, encoding="utf-8")
            if wrappers:
                title = f"{module}_memories: the memories of {module}, each in a module that another may replace"
                wrappers = header(title, config, preset, wrappers) + wrappers
                (folder / memories_file(module)).write_text(wrappers, encoding="utf-8")
            manifests.append(manifest(unit, config, preset, verilog, module, wrappers, bus))
            _write_json(folder / f"{module}.json", manifests[-1])
            progress(unit)
        rows = [{key: described[key] for key in INDEXED} for described in manifests]
        _write_json(folder / "manifest.json", {"preset": preset, "units": rows})
    return manifests


def _write_json(path: Path, content: dict[str, Any]) -> None:
    path.write_text(json.dumps(content, indent=2) + "\n", encoding="utf-8")
