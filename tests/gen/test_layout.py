"""Layout of a small unit: what is read from the router's files, and what the metal connects."""

import os
import shutil
from pathlib import Path

import pytest

from lightloom.gen.flow.layout import FILES, PROGRAMS, _extent, _wires, place_and_route
from lightloom.golden_model.host.errors import InputError
from tests.needs import need, need_package, needs

need_package("klayout", "pip install 'lightloom[flow]'")

import klayout.db as kdb  # noqa: E402 (left out where it is missing)

from lightloom.gen.flow.layout_check import METALS, VIAS, connections, violations, wanted  # noqa: E402 (it needs klayout)

needs_qflow = needs(all(shutil.which(program) for program in PROGRAMS), "apt install qflow", optional=True)

DEF = """UNITS DISTANCE MICRONS 200 ;
DIEAREA ( -200 -100 ) ( 1800 900 ) ;
NETS 2 ;
- a
+ ROUTED Metal1 ( 0 0 ) via1Array_1
  NEW Metal2 ( 0 0 ) ( * 400 ) via2Array_2
  NEW Metal3 ( 0 400 ) ( 600 * ) ( * 400 ) ;
END NETS
SPECIALNETS 1 ;
- a
+ ROUTED Metal1 42 ( 100 100 ) ( 140 * ) ;
END SPECIALNETS
"""
LEF = """MACRO buf
  PIN A
    PORT
      LAYER Metal1 ;
        RECT 0 0 0.4 0.4 ;
    END
  END A
  PIN X
    PORT
      LAYER Metal1 ;
        RECT 2 0 2.4 0.4 ;
    END
  END X
  PIN VDD
    USE POWER ;
    PORT
      LAYER Metal1 ;
        RECT 0 3 2 3.4 ;
    END
  END VDD
END buf
"""


def test_wires_and_extent() -> None:
    assert _extent(DEF) == (10.0, 5.0)
    assert _wires(DEF) == ({"Metal1": 0.2, "Metal2": 2.0, "Metal3": 3.0}, 2)


def chain(folder: Path, *, vias: bool = True, short: bool = False) -> kdb.Layout:
    """Two buffers in a row: the first one's X goes through Metal2 to the second one's A."""
    (folder / "cells.lef").write_text(LEF)
    (folder / "chain.blif").write_text(".gate buf A=i X=n\n.gate buf A=n X=o\n")
    layout = kdb.Layout()
    layout.dbu = 0.001
    layers = {name: layout.layer(number, 0) for name, number in (METALS | VIAS).items()}
    cell, top = layout.create_cell("buf"), layout.create_cell("chain")
    for x in (0.0, 2.0):
        cell.shapes(layers["Metal1"]).insert(kdb.DBox(x, 0, x + 0.4, 0.4))
    for k in (1, 2):
        place = kdb.DCellInstArray(cell.cell_index(), kdb.DTrans(10.0 * (k - 1), 0))
        top.insert(place).set_property("name", f"buf_{k}")
    top.shapes(layers["Metal2"]).insert(kdb.DBox(2.0, 0, 10.4, 0.4))
    for x in (2.1, 10.1) if vias else (2.1,):
        top.shapes(layers["Via1"]).insert(kdb.DBox(x, 0.1, x + 0.2, 0.3))
    if short:
        top.shapes(layers["Metal1"]).insert(kdb.DBox(0, 0, 2.4, 0.2))
    return layout


def test_metal_connects_what_the_netlist_does(tmp_path: Path) -> None:
    layout = chain(tmp_path)
    expected = {frozenset({"buf_1/A"}), frozenset({"buf_1/X", "buf_2/A"}), frozenset({"buf_2/X"})}
    assert connections(layout, tmp_path) == wanted(tmp_path, "chain") == expected
    assert violations(layout) == {"width": 0, "spacing": 0, "area": 0}


@pytest.mark.parametrize("fault", [{"vias": False}, {"short": True}], ids=["open", "short"])
def test_a_fault_in_the_metal_is_heard(tmp_path: Path, fault: dict) -> None:
    assert connections(chain(tmp_path, **fault), tmp_path) != wanted(tmp_path, "chain")


def test_broken_rules_are_counted(tmp_path: Path) -> None:
    layout = chain(tmp_path)
    metal = layout.top_cell().shapes(layout.layer(METALS["Metal3"], 0))
    metal.insert(kdb.DBox(0, 0, 0.15, 5))
    metal.insert(kdb.DBox(0.3, 0, 0.6, 0.3))
    assert violations(layout) == {"width": 1, "spacing": 1, "area": 1}


@needs_qflow
def test_a_root_without_the_pdk(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"^--pdk-root .*: holds no sg13g2_tech.lef$"):
        place_and_route("", "float_add", tmp_path, tmp_path)


@pytest.mark.long
@needs_qflow
@needs("PDK_ROOT" in os.environ, "PDK_ROOT names no folder with IHP SG13G2", optional=True)
def test_layout_of_a_conversion(tmp_path: Path) -> None:
    from lightloom.hardware.place_and_route import lay_out

    root = Path(os.environ["PDK_ROOT"])
    there = all(any(root.rglob(name)) for name in FILES.values())
    need(there, "PDK_ROOT holds no IHP SG13G2", optional=True)
    row = lay_out("fixed_to_float", "tiny", root, tmp_path / "out", 1)["rows"][0]
    assert row["unrouted"] == row["nets_not_in_netlist"] == 0
    assert row["nets_as_in_netlist"] == row["nets_of_netlist"] > 1000
    files = {path.name for path in (tmp_path / "out").iterdir()}
    assert files >= {"fixed_to_float.gds", "fixed_to_float.png", "layout.json"}
