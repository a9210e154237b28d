"""The page of `lightloom policies`: one HTML file without scripts or links to elsewhere, pictures inside it."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from markupsafe import Markup

from lightloom.gen.pages.pages import data_uri, environment, webp
from lightloom.gen.pages.plots import line_chart, short, stacked_bars

DASH, TIMES = "\N{EN DASH}", "\N{MULTIPLICATION SIGN}"
WIDE, HALF = 1192, 584
"""Widths of charts, as the page has them: so their letters have the size of the page's."""


def policies_page(report: Mapping[str, Any], folder: Path) -> str:
    """The page for a report (as in policies.json) about the pictures in `folder`, which the comparison has written."""
    policies = report["policies"]
    full = next(policy for policy in policies if policy["name"] == report["full"])
    numbers = [row["frame"] for row in full["frames"]]
    compared = report["reference"]["frames"]
    marks = report["key_frames"]

    def over_time(name: str, **options: Any) -> Markup:
        lines = {policy["name"]: [row[name] for row in policy["frames"]] for policy in policies}
        return Markup(line_chart(numbers, lines, marks=marks, width=HALF, **options))

    errors = {
        policy["name"]: [row["error"] for row in policy["frames"] if row["frame"] in compared] for policy in policies
    }
    kinds = ray_kinds(policies)
    pages = environment()
    pages.filters.update(percent=percent, times=times, setting=setting, code=code)
    return pages.get_template("policies.html").render(
        report=report,
        policies=policies,
        full=full,
        kinds=kinds,
        baseline=next(policy for policy in policies if policy["name"] == report["baseline"]),
        film=data_uri(folder / "film.webp"),
        frame_times=frame_times(policies),
        timeline=Markup((folder / "timeline.svg").read_text(encoding="utf-8")),
        most_error=max((p["summary"]["error"] or 0 for p in policies), default=0) or 1,
        error_chart=Markup(line_chart(compared, errors, number=percent, marks=marks, width=WIDE)),
        charts=[
            ("Updates spent on texels that the frame reads", over_time("on_visible", number=percent)),
            ("Mean age of the texels that the frame reads, in frames", over_time("age")),
            ("Age of the oldest of them, in frames", over_time("oldest")),
            ("Texels sampled", over_time("texels")),
        ],
        rays_chart=Markup(rays_chart(full, kinds, report["options"]["budget"])),
        key_frames=[key_frame(report, folder, frame) for frame in marks],
        quantities=[
            quantity
            | {
                "pictures": [webp(folder / "maps" / f"{frame:04}" / f"{quantity['name']}.png") for frame in marks],
                "maps": data_uri(folder / "maps" / f"{marks[-1]:04}" / f"{quantity['name']}-maps.png"),
            }
            for quantity in report["quantities"]
        ],
        total_seconds=sum(report["seconds"].values()),
    )


def percent(value: float | None) -> str:
    """0.1234 as 12.3 %; None as a dash."""
    if value is None:
        return DASH
    return f"{100 * value:.3g} %"


def frame_times(policies: Sequence[Mapping[str, Any]]) -> str:
    """How long a frame takes on the machine under each policy, in words; once where they do not differ."""
    found = {policy["name"]: f"{1000 * policy['summary']['machine_seconds']:.3g} ms" for policy in policies}
    if len(set(found.values())) == 1:
        return f"{next(iter(found.values()))}, whatever the policy"
    return ", ".join(f"{time} with {name}" for name, time in found.items())


def times(value: float | None) -> str:
    """A ratio: 0.412 as 0.41 and the sign of multiplication; None as a dash."""
    return DASH if value is None else f"{value:.2f}{TIMES}"


def code(text: str) -> Markup:
    """Names between backticks set as code."""
    parts = text.split("`")
    return Markup("").join(Markup("<code>{}</code>").format(part) if k % 2 else part for k, part in enumerate(parts))


def setting(value: object) -> str:
    """The value of a parameter: yes or no, numbers without noughts at the end, tuples with spaces."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, tuple | list):
        return " ".join(setting(one) for one in value)
    return f"{value:.10g}" if isinstance(value, float) else str(value)


def ray_kinds(policies: Sequence[Mapping[str, Any]]) -> list[str]:
    """The kinds of rays that any policy has traced, in the order in which they first come."""
    kinds: dict[str, None] = {}
    for policy in policies:
        kinds |= {kind: None for kind, rays in policy["summary"]["rays"].items() if rays}
    return list(kinds)


def rays_chart(policy: Mapping[str, Any], kinds: Sequence[str], budget: int) -> str:
    """Rays of each frame of one policy, by kind, below the budget."""
    rows = policy["frames"]
    return stacked_bars(
        [row["frame"] for row in rows],
        {kind: [row["rays"].get(kind, 0) for row in rows] for kind in kinds},
        limit=budget,
        limit_name=f"budget {short(budget)}",
        width=WIDE,
    )


def key_frame(report: Mapping[str, Any], folder: Path, frame: int) -> dict[str, Any]:
    """The pictures of one key frame and its figures, by policy."""
    place = folder / "frames" / f"{frame:04}"
    return {
        "number": frame,
        "reference": webp(place / "reference.png"),
        "policies": [
            {
                "name": policy["name"],
                "picture": webp(place / f"{policy['name']}.png"),
                "errors": webp(place / f"{policy['name']}-error.png"),
                "figures": next(row for row in policy["frames"] if row["frame"] == frame),
            }
            for policy in report["policies"]
        ],
    }
