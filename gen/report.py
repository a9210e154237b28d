"""The report page of a demo: one HTML file without scripts or links to elsewhere, pictures inside it."""

import base64
import io
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup
from PIL import Image

from gen.plots import short, stacked_bars

TEMPLATES = Path(__file__).with_name("templates")
KEY_FRAMES = 6
LIGHTMAPS = 6
TYPES = {".png": "image/png", ".webp": "image/webp"}


def report_page(report: Mapping[str, Any], folder: Path) -> str:
    """The page for a report (as in report.json) about the pictures in `folder`, which the demo has written."""
    environment = Environment(
        loader=FileSystemLoader(TEMPLATES),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters.update(count=lambda value: f"{value:,}", short=short, seconds=seconds)
    render = report["render"]
    rows = render["frames"]
    kinds = list(rows[0]["rays"])
    budget_chart = stacked_bars(
        [row["frame"] for row in rows],
        {kind: [row["rays"][kind] for row in rows] for kind in kinds},
        limit=render["budget"],
        limit_name=f"budget {short(render['budget'])}",
    )
    frames = [
        {"number": rows[k]["frame"], "picture": webp(folder / "frames" / f"{rows[k]['frame']:04}.png")}
        for k in _spread(len(rows), KEY_FRAMES)
    ]
    filled = render["lightmap_frames"]
    lightmaps = [
        {
            "number": filled[k],
            "sampled": rows[filled[k] - rows[0]["frame"]]["sampled"],
            "picture": data_uri(folder / "lightmap" / f"{filled[k]:04}.png"),
        }
        for k in _spread(len(filled), LIGHTMAPS)
    ]
    return environment.get_template("report.html").render(
        report=report,
        render=render,
        replay=report["replay"],
        kinds=kinds,
        film=data_uri(folder / "film.webp"),
        frames=frames,
        lightmaps=lightmaps,
        budget_chart=Markup(budget_chart),
        total_seconds=sum(report["seconds"].values()),
        frame_seconds=dict(sorted(render["frame_seconds"].items(), key=lambda item: -item[1])),
    )


def seconds(value: float) -> str:
    """12.3 s, 2 min 05 s."""
    if value < 0.1:
        return f"{1000 * value:.0f} ms"
    return f"{value:.1f} s" if value < 100 else f"{int(value // 60)} min {int(value % 60):02} s"


def data_uri(path: Path) -> str:
    """A file as a data URI."""
    return f"data:{TYPES[path.suffix]};base64,{base64.b64encode(path.read_bytes()).decode()}"


def webp(path: Path) -> str:
    """A picture as a data URI, packed so that the page stays small."""
    packed = io.BytesIO()
    with Image.open(path) as image:
        image.save(packed, format="WEBP", quality=90, method=4)
    return f"data:image/webp;base64,{base64.b64encode(packed.getvalue()).decode()}"


def _spread(count: int, most: int) -> list[int]:
    """At most `most` of the numbers 0 to count - 1, evenly spread, the first and the last among them."""
    return sorted({round(k) for k in np.linspace(0, count - 1, min(count, most))})
