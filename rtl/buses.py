# amaranth: UnusedElaboratable=no
# (a unit is also made only to ask for its ports)
"""Units of the catalogue, as they are or behind a bus."""

from collections.abc import Callable

from lightloom.rtl.catalogue import CATALOGUE
from lightloom.rtl.config import Config
from lightloom.rtl.fabric.unit import UnitComponent
from lightloom.rtl.registers.front import RegisterFront

BUSES: dict[str, Callable[[Callable[[Config], UnitComponent], Config], UnitComponent]] = {"axi4-lite": RegisterFront}
"""What a unit may stand behind, by the name of the bus."""


def component(unit: str, config: Config, bus: str = "") -> UnitComponent:
    """A unit of the catalogue, behind a bus where one is named; KeyError for an unknown one."""
    return BUSES[bus](CATALOGUE[unit], config) if bus else CATALOGUE[unit](config)


def module_name(unit: str, bus: str = "") -> str:
    """What a unit's Verilog module is called: behind a bus it is another one."""
    return f"{unit}_{bus.replace('-', '_')}" if bus else unit
