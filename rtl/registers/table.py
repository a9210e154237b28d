"""The register table: fields, laid out as registers. Hardware, SystemRDL and pages are made from it."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from enum import Enum

from lightloom.golden_model.contract.names import OF_REGISTERS, check_name
from lightloom.rtl.registers.axi_lite import DATA_BITS

GREATEST = 2 * DATA_BITS
"""Bits of a register of two words."""


class Access(Enum):
    """What software does with a field, and what the hardware does."""

    RW = "rw"
    """Software writes it and reads what it wrote; the hardware sees it."""
    RO = "ro"
    """Software reads what the hardware says now."""
    W1C = "w1c"
    """The hardware sets it, and a 1 that is written clears it. What is set in the cycle of the write stays."""
    W1P = "w1p"
    """A 1 that is written makes it high for one cycle. It reads as 0."""


@dataclass(frozen=True, kw_only=True)
class Field:
    """A field, declared once. Raises ValueError for names that cannot be used."""

    name: str
    """Of the field, and of the port of the hardware."""
    register: str
    """The register that it is in: fields of one register stand together."""
    width: int = 1
    access: Access
    meaning: str
    """A whole sentence."""
    reset: int = 0
    """What it is after a reset, where software writes it."""
    values: Mapping[str, int] = field(default_factory=dict)
    """Names of its values, where they have names."""
    held_by: str = ""
    """A read-only field of one bit: while it is 1, a write of the whole register is refused."""

    def __post_init__(self) -> None:
        for what, name in (("field", self.name), ("register", self.register), *(("value", one) for one in self.values)):
            check_name(what, name, OF_REGISTERS)


@dataclass(frozen=True, kw_only=True)
class Register:
    """One or two words of 32 bits, the lower one first."""

    name: str
    offset: int
    """In bytes; of two words a multiple of 8."""
    fields: tuple[tuple[int, Field], ...]
    """Lowest bit and field, from the lowest up."""

    @property
    def width(self) -> int:
        """32 or 64."""
        low, last = self.fields[-1]
        return DATA_BITS if low + last.width <= DATA_BITS else GREATEST

    @property
    def writable(self) -> bool:
        """Whether a write can change anything in it."""
        return any(one.access is not Access.RO for _, one in self.fields)

    @property
    def held_by(self) -> str:
        """The field that says when no write is taken; "" where one always is."""
        return self.fields[0][1].held_by


@dataclass(frozen=True)
class RegisterTable:
    """Registers in the order of their offsets."""

    registers: tuple[Register, ...]

    @property
    def fields(self) -> list[Field]:
        """Every field, from the first register to the last."""
        return [one for register in self.registers for _, one in register.fields]

    @property
    def size(self) -> int:
        """Bytes of all registers."""
        last = self.registers[-1]
        return last.offset + last.width // 8

    @property
    def address_width(self) -> int:
        """Bits of a byte address."""
        return max((self.size - 1).bit_length(), 3)


def table_of(fields: Iterable[Field]) -> RegisterTable:
    """Registers in the order in which their names come first, their fields in the order given.

    A field that software writes and that has more than 32 bits becomes two registers, NAME_low and NAME_high: what it
    is, is what both say. One that it reads may have 64. Raises ValueError for what cannot be laid out.
    """
    groups: dict[str, list[Field]] = {}
    for one in fields:
        for part in _halves(one):
            groups.setdefault(part.register, []).append(part)
    registers: list[Register] = []
    names: set[str] = set()
    for name, members in groups.items():
        placed, low = [], 0
        for one in members:
            if one.name in names:
                raise ValueError(f"two fields are named {one.name}")
            names.add(one.name)
            placed.append((low, one))
            low += one.width
        end = registers[-1].offset + registers[-1].width // 8 if registers else 0
        register = Register(name=name, offset=end, fields=tuple(placed))
        _check(register, low)
        registers.append(replace(register, offset=-(-end // (register.width // 8)) * (register.width // 8)))
    held = {one.held_by for register in registers for _, one in register.fields} - {""}
    if not held <= names:
        raise ValueError(f"no field is named {', '.join(sorted(held - names))}")
    return RegisterTable(tuple(registers))


def halves(name: str) -> tuple[str, str]:
    """The names of the halves of a field that is too wide to be written at once."""
    return f"{name}_low", f"{name}_high"


def _halves(one: Field) -> list[Field]:
    """The field, or its two halves where it is too wide to be written at once."""
    if one.access is Access.RO or one.width <= DATA_BITS:
        return [one]
    low, high = halves(one.name)
    return [
        replace(
            one,
            name=low,
            register=low,
            width=DATA_BITS,
            reset=one.reset & ((1 << DATA_BITS) - 1),
            meaning=f"{one.meaning} Here are its lower bits.",
        ),
        replace(
            one,
            name=high,
            register=high,
            width=one.width - DATA_BITS,
            reset=one.reset >> DATA_BITS,
            meaning=f"{one.meaning} Here are its upper bits.",
        ),
    ]


def _check(register: Register, bits: int) -> None:
    fields = [one for _, one in register.fields]
    if bits > GREATEST or (bits > DATA_BITS and (len(fields) > 1 or register.writable)):
        raise ValueError(f"register {register.name}: {bits} bits of {', '.join(one.name for one in fields)}")
    if len({one.held_by for one in fields}) > 1:
        raise ValueError(f"register {register.name}: its fields are held by different ones")
    for one in fields:
        if one.access in (Access.W1C, Access.W1P) and one.width != 1:
            raise ValueError(f"{one.name}: an event or a strobe has one bit")
        if not 0 <= one.reset < 1 << one.width or (one.reset and one.access is not Access.RW):
            raise ValueError(f"{one.name}: cannot be {one.reset} after a reset")
