"""The Verilog of a unit, emitted once per source text and configuration, then kept: a large one takes half a minute."""

import hashlib
from importlib.metadata import version

from lightloom.gen import verilog
from lightloom.gen.manifest import PACKAGES
from lightloom.golden_model.host.fingerprint import fingerprint
from lightloom.golden_model.host.outputs import whole_file
from lightloom.rtl.config import Config
from lightloom.sim import toolchain


def emitted(unit: str, config: Config, prefix: str = "", bus: str = "") -> str:
    """`gen.verilog.verilog_of`, from the cache where it holds the text (`sim.toolchain.cache_folder`)."""
    recipe = [prefix + unit, bus, repr(sorted(config.flat().items())), *(version(name) for name in PACKAGES)]
    recipe += [fingerprint(verilog.__name__)]
    key = hashlib.sha256("\0".join(recipe).encode()).hexdigest()[:16]
    kept = toolchain.cache_folder() / "verilog" / f"{prefix}{unit}-{key}.v"
    with toolchain.locked(kept):
        if not kept.exists():
            with whole_file(kept) as part:
                part.write_text(verilog.verilog_of(unit, config, prefix, bus), encoding="utf-8")
    return kept.read_text(encoding="utf-8")
