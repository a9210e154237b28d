"""The fields of a unit behind a bus: its ports, its events, and what its streams carry."""

from collections.abc import Iterator

import numpy as np

from lightloom.golden_model.contract import bitpack
from lightloom.rtl.fabric.unit import Port, Role, UnitComponent
from lightloom.rtl.registers.axi_lite import DATA_BITS
from lightloom.rtl.registers.table import Access, Field

NARROW = 8
"""Bits of a status that shares a register with others."""
ACCESS = {
    Role.CONTROL: Access.RW,
    Role.STROBE: Access.W1P,
    Role.STATUS: Access.RO,
    Role.COUNTER: Access.RO,
}
"""What software may do with a port."""
RESULT_CAME = "result_came"
"""The event of every unit: of all others a unit says the level (`rtl.fabric.unit.Event`)."""
WAITS = "operands_wait"
"""While this is 1, the registers of the operands are held."""


def unit_fields(unit: UnitComponent, tag_width: int) -> Iterator[Field]:
    """Every field of a unit, in the order of the registers; those of software's operations have `tag_width` bits."""
    narrow = {
        role: [_of_port(name, port) for name, port in unit.ports.items() if port.role is role and port.width <= NARROW]
        for role in (Role.STROBE, Role.STATUS)
    }
    yield from narrow[Role.STROBE]
    yield Field(
        name="release",
        register="control",
        access=Access.W1P,
        meaning="Writing 1 gives the waiting result away; the next one, if there is one, takes its place.",
    )
    yield from narrow[Role.STATUS]
    for name, meaning in (
        (WAITS, "Is 1 while operands that were submitted wait to be taken by the unit."),
        ("result_waits", "Is 1 while a result waits in the registers of the result."),
    ):
        yield Field(name=name, register="status", access=Access.RO, meaning=meaning)
    yield from _events(unit)
    for name, port in unit.ports.items():
        if port.role is Role.CONTROL or (port.role is Role.STATUS and port.width > NARROW):
            yield _of_port(name, port)
    yield from _stream("operand", unit.unit.input, tag_width)
    yield from _stream("result", unit.unit.output, tag_width)
    for name, port in unit.ports.items():
        if port.role is Role.COUNTER:
            yield _of_port(name, port)


def _events(unit: UnitComponent) -> Iterator[Field]:
    """What may have happened, and what of it raises the interrupt."""
    events = {RESULT_CAME: "a result of operands that were submitted has come"}
    events |= {event.name: event.meaning for event in unit.EVENTS}
    for name, meaning in events.items():
        says = f"Becomes 1 when {meaning}; writing 1 makes it 0."
        yield Field(name=name, register="events", access=Access.W1C, meaning=says)
    for name in events:
        says = f"Lets `{name}` raise the interrupt."
        yield Field(name=f"{name}_enable", register="event_enables", access=Access.RW, meaning=says)


def _of_port(name: str, port: Port) -> Field:
    """A port of the unit as a field."""
    shared = {Role.STROBE: "control", Role.STATUS: "status" if port.width <= NARROW else name}
    return Field(
        name=name,
        register=shared.get(port.role, name),
        width=port.width,
        access=ACCESS[port.role],
        meaning=_sentence(port),
        reset=port.reset,
        values=port.values,
    )


def _sentence(port: Port) -> str:
    """What a port means, as a whole sentence (`rtl.fabric.unit.Role`). A counter's may say first where it counts."""
    begins = {
        Role.CONTROL: "Sets the",
        Role.STROBE: "Writing 1",
        Role.STATUS: "Is 1 while" if port.width == 1 else "Says",
        Role.COUNTER: "Counts",
    }
    where, colon, what = port.meaning.partition(": ")
    if port.role is Role.COUNTER and colon:
        return f"{where[0].upper()}{where[1:]}: counts {what}."
    return f"{begins[port.role]} {port.meaning}."


# --- streams ----------------------------------------------------------------------------------------------------------


def scalars(kind: str, dtype: np.dtype) -> Iterator[tuple[str, int, int, str]]:
    """Of each scalar of a payload: its field's name, its lowest bit in the payload, its width, what it is.

    `kind` is "operand" or "result".
    """
    for name, index, base, offset, width in bitpack.fields(dtype):
        number = "".join(f"_{k}" for k in index)
        what = f"component {index[0]} of `{name}`" if index else f"`{name}`"
        form = "a float32 number" if base.kind == "f" and width == 32 else "one bit" if width == 1 else f"{width} bits"
        whose = "operands to be submitted" if kind == "operand" else "result that waits"
        yield f"{kind}_{name}{number}", offset, width, f"Is {what} of the {whose}: {form}."


def _stream(kind: str, dtype: np.dtype, tag_width: int) -> Iterator[Field]:
    """The payload of a stream and its tag: what has 32 bits or more by itself, the rest together."""
    operand = kind == "operand"
    access, held = (Access.RW, WAITS) if operand else (Access.RO, "")
    used = number = 0
    for name, _, width, meaning in scalars(kind, dtype):
        register = name
        if width < DATA_BITS:
            if used + width > DATA_BITS:
                used, number = 0, number + 1
            used += width
            register = f"{kind}_rest{number or ''}"
        yield Field(name=name, register=register, width=width, access=access, meaning=meaning, held_by=held)
    says = "the operands to be submitted; their result has the same" if operand else "the result that waits"
    yield Field(
        name=f"{kind}_tag",
        register=f"{kind}_tag",
        width=tag_width,
        access=access,
        meaning=f"Is the tag of {says}.",
        held_by=held,
    )
    if operand:
        yield Field(
            name="submit",
            register="submit",
            access=Access.W1P,
            meaning="Writing 1 offers the operands and their tag to the unit. Until they are taken, a write of this or "
            "of the operands is refused.",
            held_by=held,
        )
