"""A small register table with a field of every kind, for the tests of what is made from tables."""

from lightloom.rtl.registers.table import Access, Field, RegisterTable, table_of

FIELDS = (
    Field(name="go", register="control", access=Access.W1P, meaning="Writing 1 begins."),
    Field(name="busy", register="status", access=Access.RO, meaning="Is 1 while it works."),
    Field(
        name="mood",
        register="status",
        width=3,
        access=Access.RO,
        meaning="Says how it is.",
        values={"good": 0, "fair": 1, "bad": 5},
    ),
    Field(name="over", register="events", access=Access.W1C, meaning="Becomes 1 at the end; writing 1 makes it 0."),
    Field(name="lost", register="events", access=Access.W1C, meaning="Becomes 1 at a loss; writing 1 makes it 0."),
    Field(name="limit", register="limit", width=20, access=Access.RW, reset=0x4321, meaning="Sets the limit."),
    Field(name="place", register="place", width=40, access=Access.RW, reset=0x5_0000_0007, meaning="Sets the place."),
    Field(name="load", register="load", width=9, access=Access.RW, held_by="busy", meaning="Sets the load."),
    Field(name="send", register="send", access=Access.W1P, held_by="busy", meaning="Writing 1 sends the load."),
    Field(name="count", register="count", width=48, access=Access.RO, meaning="Counts cycles."),
    Field(name="total", register="total", width=64, access=Access.RO, meaning="Counts all."),
)


def toy_table() -> RegisterTable:
    """It."""
    return table_of(FIELDS)
