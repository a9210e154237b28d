"""Shifters and the leading-zero count: the wide logic that the number units share."""

from amaranth import Cat, Const, Module, Mux, Signal, Value


def shift_left(m: Module, value: Value, amount: Value, name: str) -> Signal:
    """`value << amount` in the width of `value`."""
    out = Signal(len(value), name=name)
    m.d.comb += out.eq(value << amount)
    return out


def shift_right(m: Module, value: Value, amount: Value, name: str, width: int | None = None) -> tuple[Signal, Signal]:
    """`value >> amount` and whether a one fell out at the low end, found beside the shift, not after it.

    Where only its `width` lowest bits are of use, there are no others.
    """
    lost: Value = Const(0, 1)
    for k, far in enumerate(amount):
        places = min(1 << k, len(value))
        bits = width if width is not None and k == len(amount) - 1 else len(value)
        shifted, fallen = Signal(bits, name=f"{name}{k}"), Signal(name=f"{name}{k}_lost")
        m.d.comb += [
            shifted.eq(Mux(far, value >> places, value)),
            fallen.eq(lost | (far & value[:places].any())),
        ]
        value, lost = shifted, fallen
    return value, lost


def leading_zeros(m: Module, value: Value, name: str) -> Signal:
    """How many zeros stand above the highest one of `value`; unspecified but at most its width for zero itself."""
    size = 1 << (len(value) - 1).bit_length()
    # Each node of the tree covers some bits and holds (all of them are zero, zeros above the highest one).
    leaves = Cat(Const(1, 1).replicate(size - len(value)), value)  # from the low end, so the ones below never count
    level: list[tuple[Value, Value]] = [(~bit, Const(0, 0)) for bit in leaves]
    depth = 0
    while len(level) > 1:
        depth += 1
        parents = []
        for index in range(0, len(level), 2):
            (low_empty, low_count), (high_empty, high_count) = level[index : index + 2]
            empty = Signal(name=f"{name}_empty{depth}_{index // 2}")
            count = Signal(depth, name=f"{name}_count{depth}_{index // 2}")
            m.d.comb += [
                empty.eq(low_empty & high_empty),
                count.eq(Cat(Mux(high_empty, low_count, high_count), high_empty)),
            ]
            parents.append((empty, count))
        level = parents
    out = Signal(depth, name=name)
    m.d.comb += out.eq(level[0][1])
    return out
