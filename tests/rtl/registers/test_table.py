# amaranth: UnusedElaboratable=no
# (units are made only to ask for their fields)
"""The layout of register tables."""

from dataclasses import replace
from typing import Any

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
        "limit": (0x0C, 32),
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


LIMIT = FIELDS[5]


@pytest.mark.parametrize(
    ("fields", "said"),
    [
        ([LIMIT, LIMIT], "two fields are named limit"),
        ([LIMIT, replace(LIMIT, name="more")], "register limit: 40 bits of limit, more"),
        ([replace(FIELDS[-1], width=65)], "register total: 65 bits of total"),
        ([replace(LIMIT, held_by="nothing")], "no field is named nothing"),
        ([LIMIT, replace(LIMIT, name="more", width=1, held_by="limit")], "its fields are held by different ones"),
        ([replace(LIMIT, reset=1 << 20)], "limit: cannot be 1048576 after a reset"),
        ([replace(FIELDS[0], width=2)], "go: an event or a strobe has one bit"),
    ],
)
def test_what_cannot_be_laid_out_is_refused(fields: list[Field], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        table_of(fields)


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"name": "field"}, "field 'field': a keyword of SystemRDL; choose another name"),
        ({"name": "class"}, r"field 'class': a keyword of C\+\+; choose another name"),
        ({"register": "reg"}, "register 'reg': a keyword of SystemRDL; choose another name"),
        ({"register": "default"}, r"register 'default': a keyword of SystemRDL, C, C\+\+; choose another name"),
        ({"values": {"none": 0, "int": 1}}, r"value 'int': a keyword of SystemRDL, C, C\+\+; choose another name"),
        ({"name": "Limit"}, "field 'Limit': a name is words of a to z and 0 to 9, joined by single underscores"),
    ],
)
def test_what_some_language_cannot_write_is_refused(changed: dict[str, Any], said: str) -> None:
    with pytest.raises(ValueError, match=f"^{said}$"):
        replace(LIMIT, **changed)


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
