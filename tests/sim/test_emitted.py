"""The cache of emitted Verilog knows everything that the Verilog depends on."""

import re
from pathlib import Path

import gen.verilog
import rtl.config
from gen.verilog import verilog_of
from rtl.config import PRESETS
from sim import emitted


def test_the_key_holds_what_the_hardware_draws_on() -> None:
    sources = [*Path(rtl.config.__file__).parent.rglob("*.py"), Path(gen.verilog.__file__)]
    drawn = {
        f"{name}.py" for path in sources for name in re.findall(r"^from golden_model\.(\w+) ", path.read_text(), re.M)
    }
    assert drawn == set(emitted.FORMATS)


def test_the_cached_text_is_the_emitted_one() -> None:
    for _ in range(2):
        assert emitted.emitted("float_compare", PRESETS["tiny"]) == verilog_of("float_compare", PRESETS["tiny"])
