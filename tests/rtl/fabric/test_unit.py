# amaranth: UnusedElaboratable=no
# (units are made only to ask for their ports)
"""What every unit is."""

import pytest

from lightloom.golden_model.contract.interfaces import UNITS
from lightloom.rtl.fabric.unit import Port, Role, UnitComponent


@pytest.mark.parametrize("name", ["register", "output", "int", "class", "field", "signal", "begin", "Go", "two__words"])
def test_a_port_that_some_language_cannot_write_is_refused(name: str) -> None:
    port = Port(role=Role.STROBE, meaning="begins", tie=0)
    assert UnitComponent(UNITS["float_add"], 4, ports={"go": port}).ports == {"go": port}
    with pytest.raises(ValueError, match=f"^unit float_add: port '{name}': a"):
        UnitComponent(UNITS["float_add"], 4, ports={"go": port, name: port})


@pytest.mark.parametrize("name", ["i", "o", "clk", "rst", "m_axi", "unit", "latency", "signature"])
def test_a_port_with_the_name_of_what_every_unit_has_is_refused(name: str) -> None:
    """It would take the place of a stream, or be one with the clock."""
    port = Port(role=Role.STROBE, meaning="begins", tie=0)
    with pytest.raises(ValueError, match=f"^unit float_add: port {name}: every unit has"):
        UnitComponent(UNITS["float_add"], 4, ports={name: port})
