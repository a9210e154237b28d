"""The Verilog of a unit, emitted once per source text and configuration, then kept: a large one takes half a minute."""

import hashlib
from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path

import golden_model
import rtl.config
from gen import verilog
from gen.manifest import PACKAGES
from golden_model.outputs import whole_file
from rtl.config import Config
from sim import toolchain

FORMATS = ("formats.py", "interfaces.py")
"""What the RTL draws on of the golden model."""


def emitted(unit: str, config: Config) -> str:
    """`gen.verilog.verilog_of`, from the cache where it holds the text (`sim.toolchain.cache_folder`)."""
    hardware, model = Path(rtl.config.__file__).parent, Path(golden_model.__file__).parent
    sources = [*sorted(hardware.rglob("*.py")), Path(verilog.__file__), *(model / name for name in FORMATS)]
    recipe = [unit, repr(sorted(asdict(config).items())), *(version(name) for name in PACKAGES)]
    recipe += [source.read_text(encoding="utf-8") for source in sources]
    key = hashlib.sha256("\0".join(recipe).encode()).hexdigest()[:16]
    kept = toolchain.cache_folder() / "verilog" / f"{unit}-{key}.v"
    with toolchain.locked(kept):
        if not kept.exists():
            with whole_file(kept) as part:
                part.write_text(verilog.verilog_of(unit, config), encoding="utf-8")
    return kept.read_text(encoding="utf-8")
