"""The page docs/registers.md, from the register table: `python -m lightloom.pages.registers > docs/registers.md`."""

import sys
from collections.abc import Iterator
from typing import Any

from lightloom.gen.manifest import manifest
from lightloom.golden_model.contract.interfaces import PURE, UNITS
from lightloom.pages.units import table
from lightloom.rtl.config import PRESETS

PRESET, BUS = "base", "axi4-lite"
ACCESSES = {
    "rw": "read, write",
    "ro": "read",
    "w1c": "read, write 1 to clear",
    "w1p": "write 1: one pulse",
}
TEXT = """\
# Registers

<!-- Made by `python -m lightloom.pages.registers > docs/registers.md`; a test holds it to the table. -->

```
lightloom package traversal --bus axi4-lite --out package     # module traversal_axi4_lite, with its registers' files
lightloom emit traversal float_add --bus axi4-lite
```

With `--bus axi4-lite` a unit is emitted behind registers, as a module of its own, `UNIT_axi4_lite`: a slave that an
SoC takes as it is. What the unit has as ports are fields; operations are given and taken through registers too. All
of it follows from what the unit declares: its ports with their roles (`rtl/fabric/unit.py`), counters, events, and
the formats of its streams. From that one table (`rtl/registers/table.py`) come the hardware
(`rtl/registers/register_block.py`), the manifest's `registers`, and SystemRDL; of the SystemRDL PeakRDL makes a C
header, IP-XACT and a page, in the package's `registers/` (that takes `pip install 'lightloom[registers]'`).

## The port

`s_axi_*` is AXI4-Lite with 32 bits of data, and an address as wide as the registers need. Address and data of a write
come in either order; a write is done in the cycle after both have come, a read in the cycle after its address, each
when the answer to the one before has been taken. Every channel may be stalled. `ready` and `valid` are registers, and
so is what is answered: no path leads from an input of the port to one of its outputs.

- A read where there is no register, and a write where there is none, or nothing to write in it, is answered with
  SLVERR; it reads 0 and changes nothing. So is a write of a register that is *held* (below).
- The two lowest bits of an address are not looked at; a byte without its strobe stays as it is.
- What is pulsed is pulsed once, in the cycle after the write, when all that was written before holds.
- An event that comes in the cycle in which it is cleared stays.
- A control of more than 32 bits is two registers, NAME_low and NAME_high.
- A register of 64 bits is read by its lower word first: that keeps the upper word, and a read of any upper word gives
  what was kept last, after a reset 0. So a counter is whole, as long as nobody reads another one between its halves.
  The SystemRDL says so by `buffer_reads`, a property that PeakRDL-regblock knows: a block that it makes of the file
  keeps the upper word of each such register by itself.

`irq` is high while an event has happened, is not cleared, and its bit in `event_enables` is 1.

## What to tie off

The streams `i` and `o` stay, for hardware that makes rays. A bit more of the tag inside says whose an operation is,
so software and hardware use the unit at the same time, and each gets its own results. Without such hardware tie
`i__valid`, `i__payload` and `o__ready` low; `s_axi_awprot` and `s_axi_arprot` where the bus has no protection. The
manifest says `tie` of each. Of AXI4's signals `m_axi` has those that it needs: the cache, protection, lock, QoS and
region signals of the memory's port are the system's to set.

## To trace rays

1. Put a tree into memory ([memory_image](memory_image.md)), and its byte address into `base_low` and `base_high`.
2. Write 1 to `load` in `control`. Wait until `loaded` in `status` is 1, or `load_error` is not 0; or enable
   `load_over`, and wait for `irq`.
3. Write a ray into the `operand_*` registers and a tag into `operand_tag`, then 1 to `submit`. Until the unit takes
   it `operands_wait` is 1, and these registers are held: a write is answered with SLVERR.
4. While `result_waits` is 1, the result is in the `result_*` registers. Read it, then write 1 to `release` in
   `control`. Results come in any order; two wait in the registers at most, those behind them in the unit. So take
   results between rays: who gives rays and takes no results finds `operands_wait` at 1 for ever, and hardware at the
   streams waits, too.

Who waits for `irq` clears `result_came` first, and then takes results until `result_waits` is 0: two results may be
one event.

`abort` forgets what is under way, what waits in the registers too; `abort_over` tells when that is done. Until then
what is written to `load` and `submit` is lost. Events that have happened stay, `result_came` too, until cleared.
A unit whose addresses have 32 bits or fewer has one register `base`.
`examples/registers/trace.c` is a program that does this, and a test that runs it on the Verilog finds the golden
model's results, in all bits.

## How it is tried

| what | where |
|---|---|
| the protocol and what accesses do: proved for all time; its faults are noticed | `gen/formal/register_block.py` |
| the register block against a model, all channels stalled, all that it reads in motion | `tests/rtl/registers/` |
| registers and streams at a time, by cocotbext-axi's master, on both simulators | `verif/benches/test_registers.py` |
| resets, events while they are cleared, interrupt, counters that carry, aborts | `verif/benches/test_front*.py` |
| rays through registers by a program in C, and aborts, on Verilator | `tests/sim/test_register_bus.py` |
| PeakRDL's regblock, html, ip-xact and c-header read the SystemRDL | `tests/gen/test_package_files.py` |
"""


def page() -> str:
    """The whole page."""
    return "\n".join([TEXT, *(text for unit in UNITS if unit not in PURE for text in _unit(unit))])


def _unit(unit: str) -> Iterator[str]:
    """A unit that has ports besides its streams."""
    head = ["offset", "register", "bits", "field", "access", "reset", "meaning"]
    yield f"## The registers of `{unit}`, preset `{PRESET}`\n"
    yield "Offsets are in bytes. A register that says *held* is, while `operands_wait` is 1.\n"
    yield table(head, _rows(manifest(unit, PRESETS[PRESET], bus=BUS)["registers"]))


def _rows(registers: list[dict[str, Any]]) -> Iterator[list[str]]:
    for register in registers:
        offset, name = f"`0x{register['offset']:03x}`", f"`{register['name']}`"
        for field in register["fields"]:
            high, low = field["low"] + field["width"] - 1, field["low"]
            access = ACCESSES[field["access"]] + (", held" if "held_by" in field else "")
            reset = f"`0x{field['reset']:x}`" if "reset" in field else "-"
            bits = f"{high}:{low}" if high > low else f"{low}"
            yield [offset, name, bits, f"`{field['name']}`", access, reset, field["meaning"]]
            offset = name = ""


if __name__ == "__main__":
    sys.stdout.write(page())
