"""Merges a routed layout with its cells, draws it, and extracts from its metal which pins are connected."""

import os
import re
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import klayout.db as kdb
import klayout.lay as klay

METALS = {"Metal1": 8, "Metal2": 10, "Metal3": 30, "Metal4": 50, "Metal5": 67}
VIAS = {"Via1": 19, "Via2": 29, "Via3": 49, "Via4": 66}
"""Layers of IHP SG13G2: name in LEF and number in GDS."""
COLOURS = {8: 0x4C7FB8, 10: 0xD2663C, 30: 0x5FA055, 50: 0x8C6BB1, 67: 0xC9A227, 5: 0xB9C2CC, 31: 0xF1F3F5}
"""What is drawn: the wells, the gates, then the metals from the lowest up."""
RULES = {"Metal1": (0.16, 0.18, 0.09), **dict.fromkeys(("Metal2", "Metal3", "Metal4", "Metal5"), (0.20, 0.21, 0.144))}
"""The least width, spacing (micrometres) and area of a metal, from the technology's LEF."""
TEXTS = 250
"""A layer of its own for the names of pins."""


def merge(folder: Path, top: str) -> kdb.Layout:
    """The layout of `TOP_routed.def` with the cells' own geometry; also written as `TOP.gds`."""
    options = kdb.LoadLayoutOptions()
    config = options.lefdef_config
    config.lef_files = [str(folder / name) for name in ("tech.lef", "cells.lef")]
    config.read_lef_with_def = False  # only these
    config.macro_resolution_mode = 2  # cells from the GDS, never their outlines from LEF
    config.macro_layout_files = [str(folder / "cells.gds")]
    config.produce_obstructions = config.produce_blockages = config.produce_cell_outlines = False
    config.create_other_layers = False
    config.layer_map = _layer_map()
    config.instance_property_name = "name"
    layout = kdb.Layout()
    with _silent():  # about layers that nobody asked for, and the grid
        layout.read(str(folder / f"{top}_routed.def"), options)
    layout.write(str(folder / f"{top}.gds"))
    return layout


@contextmanager
def _silent() -> Iterator[None]:
    """Keeps what a library writes to stdout by itself from the user."""
    sys.stdout.flush()
    kept = os.dup(1)
    with Path(os.devnull).open("w") as nowhere:
        os.dup2(nowhere.fileno(), 1)
    try:
        yield
    finally:
        os.dup2(kept, 1)
        os.close(kept)


def _layer_map() -> kdb.LayerMap:
    layers = kdb.LayerMap()
    for index, (name, number) in enumerate((METALS | VIAS).items()):
        layers.map(f"{name} : {number}/0", index)
    return layers


def connections(layout: kdb.Layout, folder: Path) -> set[frozenset[str]]:
    """The groups of cells' pins (INSTANCE/PIN) that the metal of a merged layout connects."""
    pins = _pins((folder / "cells.lef").read_text())
    top = layout.top_cell()
    flat = kdb.Layout()
    flat.dbu = layout.dbu
    cell = flat.create_cell(top.name)
    shapes = {}
    for name, number in (METALS | VIAS).items():
        shapes[name] = flat.layer(number, 0)
        cell.shapes(shapes[name]).insert(kdb.Region(top.begin_shapes_rec(layout.layer(number, 0))).merged())
    texts = flat.layer(TEXTS, 0)
    for instance in top.each_inst():
        name = instance.property("name")
        for pin, (x, y) in pins.get(instance.cell.name, {}).items():
            place = instance.dcplx_trans * kdb.DPoint(x, y)
            cell.shapes(texts).insert(kdb.DText(f"{name}/{pin}", kdb.DTrans(place.x, place.y)))
    extraction = kdb.LayoutToNetlist(kdb.RecursiveShapeIterator(flat, cell, []))
    regions = {name: extraction.make_layer(layer, name) for name, layer in shapes.items()}
    labels = extraction.make_text_layer(texts, "texts")
    for region in regions.values():
        extraction.connect(region)
    for k, via in enumerate(VIAS, 1):
        extraction.connect(regions[f"Metal{k}"], regions[via])
        extraction.connect(regions[via], regions[f"Metal{k + 1}"])
    extraction.connect(regions["Metal1"], labels)
    extraction.extract_netlist()
    nets = extraction.netlist().circuit_by_name(top.name).each_net()
    return {frozenset(net.name.split(",")) for net in nets if "/" in net.name}


def wanted(folder: Path, top: str) -> set[frozenset[str]]:
    """The groups of pins that the netlist connects. qflow calls the Nth cell of a kind KIND_N."""
    numbers: dict[str, int] = {}
    nets: dict[str, set[str]] = {}
    for line in (folder / f"{top}.blif").read_text().splitlines():
        if line.startswith(".gate "):
            _, kind, *pins = line.split()
            numbers[kind] = numbers.get(kind, 0) + 1
            for pin, net in (pair.split("=", 1) for pair in pins):
                nets.setdefault(net, set()).add(f"{kind}_{numbers[kind]}/{pin}")
    return {frozenset(group) for group in nets.values()}


def violations(layout: kdb.Layout) -> dict[str, int]:
    """Places where the metal of a layout breaks the simplest rules (RULES), by rule: width, spacing, area."""
    found = dict.fromkeys(("width", "spacing", "area"), 0)
    for name, (width, spacing, area) in RULES.items():
        region = kdb.Region(layout.top_cell().begin_shapes_rec(layout.layer(METALS[name], 0))).merged()
        found["width"] += region.width_check(round(width / layout.dbu)).count()
        found["spacing"] += region.space_check(round(spacing / layout.dbu)).count()
        found["area"] += sum(polygon.area() * layout.dbu**2 < area for polygon in region.each())
    return found


def _pins(lef: str) -> dict[str, dict[str, tuple[float, float]]]:
    """A point in the metal of every signal pin of every cell."""
    found: dict[str, dict[str, tuple[float, float]]] = {}
    for cell, body in re.findall(r"^MACRO (\S+)(.*?)^END \1", lef, re.MULTILINE | re.DOTALL):
        for pin, text in re.findall(r"^\s*PIN (\S+)(.*?)^\s*END \1", body, re.MULTILINE | re.DOTALL):
            rect = re.search(r"RECT\s+(\S+)\s+(\S+)\s+(\S+)\s+(\S+)", text[text.find("LAYER Metal1") :])
            if rect and not re.search(r"USE\s+(POWER|GROUND)", text):
                x0, y0, x1, y1 = map(float, rect.groups())
                found.setdefault(cell, {})[pin] = ((x0 + x1) / 2, (y0 + y1) / 2)
    return found


def draw(
    folder: Path, top: str, picture: Path, *, pixels: int, box: tuple[float, float, float, float] | None = None
) -> None:
    """Draws `TOP.gds` as a PNG of `pixels` squared; `box`: only x0, y0, x1, y1 in micrometres."""
    view = klay.LayoutView()
    for option, value in {
        "background-color": "#ffffff",
        "grid-visible": "false",
        "text-visible": "false",
        "cell-box-visible": "false",
    }.items():
        view.set_config(option, value)
    view.load_layout(str(folder / f"{top}.gds"), False)
    view.clear_layers()
    for number, colour in sorted(COLOURS.items(), key=lambda item: (item[0] not in (31, 5), item[0] != 31)):
        layer = klay.LayerProperties()
        layer.source = f"{number}/0"
        layer.fill_color = layer.frame_color = colour
        layer.dither_pattern = 0
        layer.frame_brightness = -20
        view.insert_layer(view.end_layers(), layer)
    view.max_hier()
    view.zoom_box(kdb.DBox(*box)) if box else view.zoom_fit()
    view.save_image(str(picture), pixels, pixels)
