"""Verilog-2001 of a unit."""

import os

from rtl.catalogue import CATALOGUE
from rtl.config import Config

# The Yosys wheel, never a Yosys of the host: the text must not depend on the machine.
os.environ["AMARANTH_USE_YOSYS"] = "builtin"

from amaranth.back import verilog


def verilog_of(unit: str, config: Config) -> str:
    """The Verilog of one unit of the catalogue, as module `unit` (KeyError for an unknown one).

    Ports: clk, rst (synchronous, active high), i__valid, i__ready, i__payload, o__valid, o__ready, o__payload.
    """
    return verilog.convert(CATALOGUE[unit](config), name=unit, emit_src=False, strip_internal_attrs=True)
