"""The cache of emitted Verilog knows everything that the Verilog depends on."""

import re

from lightloom.gen.verilog import verilog_of
from lightloom.rtl.config import PRESETS
from lightloom.sim import emitted
from tests import ROOT


def test_the_key_holds_what_the_hardware_draws_on() -> None:
    sources = [
        *(ROOT / "rtl").rglob("*.py"),
        *(ROOT / "golden_model" / "contract").rglob("*.py"),
        ROOT / "gen" / "verilog.py",
    ]
    drawn = {name for path in sources for name in re.findall(r"^from (lightloom\S*) ", path.read_text(), re.M)}
    held = re.compile(r"lightloom\.(rtl|golden_model\.contract)\b")
    assert [name for name in sorted(drawn) if not held.match(name)] == []


def test_the_cached_text_is_the_emitted_one() -> None:
    for _ in range(2):
        assert emitted.emitted("float_compare", PRESETS["tiny"]) == verilog_of("float_compare", PRESETS["tiny"])
