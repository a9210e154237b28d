"""Logic without state, tried on every input at once: a wire is one long integer with a bit for each input."""

import json
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
from amaranth.back import rtlil
from amaranth.hdl import Fragment, Signal, Value
from amaranth.lib import data, wiring

from lightloom.gen.flow import tools
from lightloom.rtl.fabric.pipeline import Core

CHUNK_BITS = 18
"""Inputs at a time, as a power of two: bounds memory."""

SCRIPT = """
read_rtlil top.il
prep -flatten -top top
opt -full
techmap
simplemap
opt_clean
write_json top.json
"""


class Gates:
    """A component without state, as gates.

    Attributes: `inputs`, `outputs`: widths of its ports by name, in order. Raises InputError where Yosys is missing.
    """

    def __init__(self, component: wiring.Component, inputs: Mapping[str, Value], outputs: Mapping[str, Value]):
        self.inputs = {name: len(value) for name, value in inputs.items()}
        self.outputs = {name: len(value) for name, value in outputs.items()}
        ports: dict[str, Signal] = {}
        fragment = Fragment.get(component, None)
        for name, value in inputs.items():
            ports[f"i_{name}"] = port = Signal(len(value), name=f"i_{name}")
            fragment.add_statements("comb", value.eq(port))
        for name, value in outputs.items():
            ports[f"o_{name}"] = port = Signal(len(value), name=f"o_{name}")
            fragment.add_statements("comb", port.eq(value))
        text, _ = rtlil.convert_fragment(fragment, {name: (port, None) for name, port in ports.items()}, "top")
        with tempfile.TemporaryDirectory(prefix="lightloom-") as scratch:
            folder = Path(scratch)
            (folder / "top.il").write_text(text, encoding="utf-8")
            tools.yosys(SCRIPT, folder)
            module = json.loads((folder / "top.json").read_text())["modules"]["top"]
        self._ports = {name: port["bits"] for name, port in module["ports"].items()}
        self._gates = _in_order(list(module["cells"].values()), known={"0", "1", *self._bits("i_")})

    @classmethod
    def of_core(cls, core: Core) -> "Gates":
        """A core of depth 0, by the fields of its operands and results."""
        return cls(core, dict(_fields(core.i)), dict(_fields(core.o)))

    def _bits(self, prefix: str) -> list[int]:
        return [bit for name, bits in self._ports.items() if name.startswith(prefix) for bit in bits]

    def run(
        self, *, free: Mapping[str, int] | None = None, fixed: Mapping[str, int] | None = None
    ) -> Iterator[tuple[dict[str, np.ndarray], dict[str, np.ndarray]]]:
        """All inputs, in chunks: operands and results by name, as int64.

        `free`: how many of an input's low bits take all values, where it is not all of them; `fixed` gives the others.
        """
        free, fixed = self.inputs | dict(free or {}), fixed or {}
        total = sum(free.values())
        low = min(total, CHUNK_BITS)
        ones = (1 << (1 << low)) - 1
        patterns = [_alternating(bit, low) for bit in range(low)]
        for chunk in range(1 << (total - low)):
            wires: dict[Wire, int] = {"0": 0, "1": ones, "x": 0}
            operands, place = {}, 0
            numbers = np.arange(1 << low) + (chunk << low)
            for name, width in free.items():
                rest = fixed.get(name, 0) >> width << width
                operands[name] = (numbers >> place & (1 << width) - 1) | rest
                for k, bit in enumerate(self._ports[f"i_{name}"]):
                    if k >= width:
                        wires[bit] = ones if rest >> k & 1 else 0
                        continue
                    high = ones if place >= low and chunk >> (place - low) & 1 else 0
                    wires[bit] = patterns[place] if place < low else high
                    place += 1
            for kind, output, a, b, select in self._gates:
                wires[output] = _GATES[kind](wires[a], wires[b], wires[select], ones)
            yield operands, {name: self._numbers(f"o_{name}", wires, low) for name in self.outputs}

    def _numbers(self, port: str, wires: Mapping["Wire", int], low: int) -> np.ndarray:
        """What the wires of a port say, input by input."""
        out = np.zeros(1 << low, np.int64)
        for place, bit in enumerate(self._ports[port]):
            packed = np.frombuffer(wires[bit].to_bytes(max(1, (1 << low) // 8), "little"), np.uint8)
            out |= np.unpackbits(packed, bitorder="little", count=1 << low).astype(np.int64) << place
        return out


# Yosys's gates: operands a and b, select (of a multiplexer, which takes b), all ones.
_GATES = {
    "$_NOT_": lambda a, b, s, ones: a ^ ones,
    "$_BUF_": lambda a, b, s, ones: a,
    "$_AND_": lambda a, b, s, ones: a & b,
    "$_OR_": lambda a, b, s, ones: a | b,
    "$_XOR_": lambda a, b, s, ones: a ^ b,
    "$_NAND_": lambda a, b, s, ones: (a & b) ^ ones,
    "$_NOR_": lambda a, b, s, ones: (a | b) ^ ones,
    "$_XNOR_": lambda a, b, s, ones: a ^ b ^ ones,
    "$_ANDNOT_": lambda a, b, s, ones: a & (b ^ ones),
    "$_ORNOT_": lambda a, b, s, ones: a | (b ^ ones),
    "$_MUX_": lambda a, b, s, ones: a ^ ((a ^ b) & s),
}

Wire = int | str
Gate = tuple[str, Wire, Wire, Wire, Wire]


def _in_order(cells: list[dict], known: set[Wire]) -> list[Gate]:
    """Gates after those that they depend on. A cell that is no gate, such as a register, is an error."""
    waiting: list[Gate] = []
    for cell in cells:
        if cell["type"] in ("$scopeinfo",):
            continue
        assert cell["type"] in _GATES, f"{cell['type']}: no gate"
        wire = {name: bits[0] for name, bits in cell["connections"].items()}
        waiting.append((cell["type"], wire["Y"], wire["A"], wire.get("B", "0"), wire.get("S", "0")))
    drivers = {gate[1]: gate for gate in waiting}
    ordered: list[Gate] = []
    placed = set(known) | {"x"}
    for gate in waiting:
        stack = [gate]
        while stack:
            top = stack[-1]
            missing = [wire for wire in top[2:] if wire not in placed]
            if missing:
                stack += [drivers[wire] for wire in missing]
                continue
            stack.pop()
            if top[1] not in placed:
                placed.add(top[1])
                ordered.append(top)
    return ordered


def _alternating(bit: int, low: int) -> int:
    """Bit `bit` of the numbers from 0 to 2**low - 1, number n at place n."""
    pattern = ((1 << (1 << bit)) - 1) << (1 << bit)
    for size in range(bit + 1, low):
        pattern |= pattern << (1 << size)
    return pattern


def _fields(view: data.View) -> Iterator[tuple[str, Value]]:
    for name, _ in view.shape():
        yield name, Value.cast(view[name])
