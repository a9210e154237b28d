"""Gates of operations on whole numbers, which are synthesised as the number units are.

`python -m lightloom.hardware.integer_gates` prints them: each is Verilog of one line and a register for its result.
What docs/arithmetic.md takes for a bit of each is fitted to that.
"""

from collections.abc import Iterator

from lightloom.hardware.synthesis import Options, measure

Operation = tuple[str, *tuple[int, ...]]

RATES = {"sum": 17.0, "compare": 6.3, "larger": 15.0, "shift": 4.7, "divide": 26.0, "place": 4.0}
"""Gates of a bit of a sum, of a comparison, of the larger of two, of a number whose highest bit is looked for; of a bit
and stage of a shift; of a bit of the divisor for each of the quotient, as in `float_divide`."""
ROW, FIRST_ROW = 13.0, 4.0
"""Gates a bit of the longer factor of a product, for each bit of the shorter one; the first row needs no adder."""
HALF_BITS, WHOLE_BITS, HALF_RATE = 11, 41, 12.0
"""A binary16 number as a whole one: its significand is shifted by its exponent. Gates a bit of the result."""
ROOT_BITS = 8
"""Behind the highest bit, that a logarithm in half octaves compares with the root of two."""
HASH = 2, 16, 32
"""Products that a counter takes in a hash, and their bits: half the rows of 32 by 32, whose upper bits are left out."""


def gates(operation: Operation) -> float:
    """Of an operation on whole numbers and its widths in bits, as `bench.counting` names it."""
    name, *widths = operation
    if name == "half to whole":
        return HALF_RATE * WHOLE_BITS
    if name == "hash":
        products, *sides = HASH
        return widths[0] * products * gates(("product", *sides))
    if name == "product":
        return max(widths) * (ROW * (min(widths) - 1) + FIRST_ROW)
    if name == "logarithm":
        place = RATES["place"] * widths[0]
        return place + gates(("shift", ROOT_BITS, widths[0].bit_length())) + gates(("compare", ROOT_BITS))
    if name == "shift":
        return RATES[name] * widths[0] * widths[1]
    if name == "divide":
        return RATES[name] * widths[1] * max(widths[0] - widths[1] + 1, 1)
    return RATES[name] * widths[0]


def _tried() -> Iterator[tuple[Operation, str, str, str]]:
    """Operations, their inputs, results and expressions in Verilog."""
    for width in (32, 64):
        yield ("sum", width), f"[{width - 1}:0] a, b", f"[{width - 1}:0]", "a + b"
    yield ("compare", 32), "[31:0] a, b", "", "a < b"
    yield ("larger", 16), "[15:0] a, b", "[15:0]", "(a < b) ? b : a"
    for one, two in ((12, 12), (24, 24), (3, 40)):
        yield ("product", one, two), f"[{one - 1}:0] a, input [{two - 1}:0] b", f"[{one + two - 1}:0]", "a * b"
    yield ("shift", 64, 4), "[63:0] a, input [3:0] b", "[63:0]", "a << b"
    yield ("half to whole",), f"[{HALF_BITS - 1}:0] a, input [4:0] b", f"[{WHOLE_BITS - 1}:0]", "a << b"
    yield ("place", 40), "[39:0] a", "[5:0]", " : ".join([f"a[{k}] ? 6'd{k}" for k in range(39, 0, -1)] + ["6'd0"])


def main() -> None:
    """Prints what each takes, and what the rates say of it."""
    for operation, inputs, result, expression in _tried():
        name = "_".join(map(str, operation)).replace(" ", "_")
        always = f"always @(posedge clk) if (en) z <= {expression};"
        verilog = f"module {name}(input clk, input en, input {inputs}, output reg {result} z);\n  {always}\nendmodule\n"
        found = measure(name, "base", None, Options(), verilog=verilog).gates
        assert found is not None
        print(*operation, found.everything, round(gates(operation)), flush=True)


if __name__ == "__main__":
    main()
