# amaranth: UnusedElaboratable=no
# (units are made only to ask for their fields)
"""The layout of register tables."""

from dataclasses import replace

import pytest

from lightloom.rtl.buses import component
from lightloom.rtl.catalogue import CATALOGUE
from lightloom.rtl.config import PRESETS
from lightloom.rtl.fabric.unit import UnitComponent
from lightloom.rtl.registers.front import RegisterFront
from lightloom.rtl.registers.table import Access, Field, table_of
from tests.rtl.registers.toy import FIELDS, toy_table


def test_registers_lie_one_behind_the_other() -> None:
    places = {register.name: (register.offset, register.width) for register in toy_table().registers}
    assert places == {
        "control": (0x00, 32),
        "status": (0x04, 32),
        "events": (0x08, 32),
        "level": (0x0C, 32),
        "place_low": (0x10, 32),
        "place_high": (0x14, 32),
        "load": (0x18, 32),
        "send": (0x1C, 32),
        "count": (0x20, 64),
        "total": (0x28, 64),
    }
    assert (toy_table().size, toy_table().address_width) == (0x30, 6)


def test_two_words_begin_at_a_multiple_of_eight() -> None:
    table = table_of([FIELDS[0], FIELDS[-1], FIELDS[1]])
    assert [register.offset for register in table.registers] == [0, 8, 16]


def test_what_is_too_wide_to_be_written_has_halves() -> None:
    low, high = (one for one in toy_table().fields if one.name.startswith("place"))
    assert (low.name, low.width, low.reset) == ("place_low", 32, 7)
    assert (high.name, high.width, high.reset) == ("place_high", 8, 5)


LEVEL = FIELDS[5]


@pytest.mark.parametrize(
    ("fields", "said"),
    [
        ([LEVEL, LEVEL], "two fields are named level"),
        ([LEVEL, replace(LEVEL, name="more")], "register level: 40 bits of level, more"),
        ([replace(FIELDS[-1], width=65)], "register total: 65 bits of total"),
        ([replace(LEVEL, held_by="nothing")], "no field is named nothing"),
        ([LEVEL, replace(LEVEL, name="more", width=1, held_by="level")], "its fields are held by different ones"),
        ([replace(LEVEL, reset=1 << 20)], "level: cannot be 1048576 after a reset"),
        ([replace(FIELDS[0], width=2)], "go: an event or a strobe has one bit"),
    ],
)
def test_what_cannot_be_laid_out_is_refused(fields: list[Field], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        table_of(fields)


@pytest.mark.parametrize("unit", CATALOGUE)
def test_every_port_and_scalar_of_a_unit_is_a_field(unit: str) -> None:
    front, alone = component(unit, PRESETS["base"], "axi4-lite"), CATALOGUE[unit](PRESETS["base"])
    assert isinstance(front, RegisterFront)
    assert isinstance(alone, UnitComponent)
    fields = {one.name: one for one in front.table.fields}
    for name, port in alone.ports.items():
        parts = [one for one in fields.values() if one.name in (name, f"{name}_low", f"{name}_high")]
        assert sum(one.width for one in parts) == port.width, name
        assert (parts[0].access is Access.RO) == (alone.signature.members[name].flow.name == "Out")
    # Whole sentences, which no two fields share.
    meanings = [one.meaning for one in fields.values()]
    assert len(set(meanings)) == len(meanings)
    for meaning in meanings:
        assert meaning[0].isupper()
        assert meaning.endswith(".")
        assert len(meaning.split()) >= 3
