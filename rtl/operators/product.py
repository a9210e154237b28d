"""The product of two significands as two rows whose sum it is, so that a register stage may stand before the sum."""

from itertools import chain

from amaranth import Cat, Const, Module, Signal, Value


def triple(m: Module, x: Value, name: str) -> Signal:
    """3 * x, two bits wider: all that the rows of a radix-4 product need beside x itself."""
    out = Signal(len(x) + 2, name=name)
    m.d.comb += out.eq(x + (x << 1))
    return out


def product_rows(m: Module, x: Value, triple_x: Value, y: Value, name: str) -> tuple[Signal, Signal]:
    """Two rows, each as long as x and y together, whose sum, cut to that length, is x * y.

    Two bits of y select a row of 0, x, 2x or 3x; the rows are added without carries. Beside Booth's recoding this costs
    the adder of 3x and saves signs, a row and the exclusive ors of the negation: 10 % of the gates.
    """
    width = len(x) + len(y)
    rows: list[Value] = []
    for place in range(0, len(y), 2):
        low, high = y[place], y[place + 1] if place + 1 < len(y) else Const(0, 1)
        row = Signal(len(x) + 2, name=f"{name}_row{place}")
        once, twice, thrice = (Signal(name=f"{name}_{part}{place}") for part in ("once", "twice", "thrice"))
        m.d.comb += [
            once.eq(low & ~high),
            twice.eq(high & ~low),
            thrice.eq(high & low),
            row.eq(
                (x & once.replicate(len(row)))
                | (Cat(Const(0, 1), x) & twice.replicate(len(row)))
                | (triple_x & thrice.replicate(len(row)))
            ),
        ]
        rows.append(Cat(Const(0, place), row)[:width])
    return sum_rows(m, rows, width, name)


def block_rows(m: Module, x: Value, y: Value, name: str) -> tuple[Signal, Signal]:
    """The same with multipliers, one for either half of y: 24x12 bits in float32, as FPGA blocks take them."""
    width, half = len(x) + len(y), len(y) // 2
    low, high = Signal(width, name=f"{name}_low"), Signal(width, name=f"{name}_high")
    m.d.comb += [low.eq(x * y[:half]), high.eq(Cat(Const(0, half), x * y[half:]))]
    return low, high


def sum_rows(m: Module, rows: list[Value], width: int, name: str) -> tuple[Signal, Signal]:
    """Two rows with the sum of `rows`, modulo 2**width: layers of full adders, three rows to two."""
    layer = 0
    while len(rows) > 2:
        taken = len(rows) // 3 * 3
        pairs = [full_adders(m, rows[k : k + 3], width, f"{name}_{layer}_{k}") for k in range(0, taken, 3)]
        rows = [*chain.from_iterable(pairs), *rows[taken:]]
        layer += 1
    low, high = Signal(width, name=f"{name}_low"), Signal(width, name=f"{name}_high")
    m.d.comb += [low.eq(rows[0]), high.eq(rows[1])]
    return low, high


def full_adders(m: Module, rows: list[Value], width: int, name: str) -> tuple[Signal, Signal]:
    """Sums and carries of three rows, bit by bit."""
    a, b, c = rows
    either, total, carry = (Signal(width, name=f"{name}_{part}") for part in ("either", "sum", "carry"))
    m.d.comb += [
        either.eq(a ^ b),
        total.eq(either ^ c),
        carry.eq(Cat(Const(0, 1), (a & b) | (either & c))),
    ]
    return total, carry
