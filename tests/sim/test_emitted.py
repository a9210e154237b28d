"""The cache of emitted Verilog."""

from lightloom.gen.verilog import verilog_of
from lightloom.rtl.config import PRESETS
from lightloom.sim import emitted


def test_the_cached_text_is_the_emitted_one() -> None:
    for _ in range(2):
        assert emitted.emitted("float_compare", PRESETS["tiny"]) == verilog_of("float_compare", PRESETS["tiny"])
