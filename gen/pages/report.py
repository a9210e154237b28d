"""The report page of a demo: one HTML file without scripts or links to elsewhere, pictures inside it."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup

from lightloom.gen.pages.pages import data_uri, environment, webp
from lightloom.gen.pages.plots import short, stacked_bars

KEY_FRAMES = 6
LIGHTMAPS = 6


def report_page(report: Mapping[str, Any], folder: Path) -> str:
    """The page for a report (as in report.json) about the pictures in `folder`, which the demo has written."""
    render = report["render"]
    rows = render["frames"]
    kinds = [kind for kind in rows[0]["rays"] if any(row["rays"][kind] for row in rows)]
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
    return (
        environment()
        .get_template("report.html")
        .render(
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
    )


def _spread(count: int, most: int) -> list[int]:
    """At most `most` of the numbers 0 to count - 1, evenly spread, the first and the last among them."""
    return sorted({round(k) for k in np.linspace(0, count - 1, min(count, most))})
