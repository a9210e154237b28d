"""The page that compares policies, on made-up figures: what it says, shows and needs."""

import html.parser
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lightloom.gen.pages.plots import line_chart
from lightloom.gen.pages.policies_page import code, frame_times, percent, policies_page, setting, times
from lightloom.golden_model.pictures.images import write_film, write_png

KEY_FRAMES = [4, 8]
KINDS = {"indirect": 700, "shadow": 100, "visibility": 0}
ERRORS = {"round-robin": 0.2, "visibility": 0.1, "influence": 0.05}


class Page(html.parser.HTMLParser):
    """Collects what a page refers to, its tags and its text."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.links: list[str] = []
        self.text = ""
        self.feed(text)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.links += [value or "" for name, value in attrs if name in ("src", "href", "srcset", "data")]

    def handle_data(self, data: str) -> None:
        self.text += data


def made_up(folder: Path) -> dict[str, Any]:
    """A report of three policies over nine frames, every second compared, and its pictures in `folder`."""
    picture = np.zeros((6, 8, 3), dtype=np.uint8)
    quantities = ("priority", "degree")
    for frame in KEY_FRAMES:
        for name in ("reference", *ERRORS, *(f"{policy}-error" for policy in ERRORS)):
            write_png(folder / "frames" / f"{frame:04}" / f"{name}.png", picture)
        for name in quantities:
            write_png(folder / "maps" / f"{frame:04}" / f"{name}.png", picture)
            write_png(folder / "maps" / f"{frame:04}" / f"{name}-maps.png", picture)
    write_film(folder / "film.webp", [picture, picture + 1])
    (folder / "timeline.svg").write_text("<svg><title>stages</title></svg>")
    policies: list[dict[str, Any]] = []
    for name, error in ERRORS.items():
        rays = KINDS | {"visibility": 0 if name == "round-robin" else 17}
        rows = [
            {
                "frame": frame,
                "texels": 40,
                "rays": rays,
                "spent": sum(rays.values()),
                "visible": 100,
                "on_visible": 0.5,
                "unknown": 0.0,
                "age": 3.5 if frame else None,
                "oldest": 9,
                "seconds": 0.1,
            }
            | ({"error": error, "relative_mse": error / 10} if frame % 2 == 0 else {})
            | ({"flip": 0.0123} if frame in KEY_FRAMES else {})
            for frame in range(9)
        ]
        row = {
            "name": "sweep",
            "value": 48,
            "before": 0,
            "range": (0, 256),
            "choices": None,
            "meaning": "With `probe`.",
        }
        policies.append(
            {
                "name": name,
                "about": f"About {name} <&>.",
                "before": policies[-1]["name"] if policies else None,
                "changes": [row] if policies else [],
                "summary": {
                    "error": error,
                    "error_ratio": error / 0.2,
                    "worst_error": error,
                    "relative_mse": error / 10,
                    "relative_mse_ratio": error / 0.2,
                    "flip": 0.0123,
                    "flip_ratio": 1.0,
                    "jump": 0.0456,
                    "lag": 17,
                    "never_shown": int(name == "round-robin"),
                    "darkened": None,
                    "true_error": 0.0321,
                    "true_energy": 0.987,
                    "true_noise": 0.0011,
                    "texels": 40.0,
                    "on_visible": 0.5,
                    "unknown": 0.0,
                    "age": 3.5,
                    "oldest": 9,
                    "rays": rays,
                    "largest_spent": sum(rays.values()),
                    "within_budget": name != "visibility",
                    "deciding": float(rays["visibility"]),
                    "first_rays": 5000,
                    "machine_seconds": 0.0012345,
                    "seconds": 0.9,
                },
                "frames": rows,
            }
        )
    options = {"width": 8, "height": 6, "budget": 1000, "seed": 3, "directions": 16, "light_samples": 4}
    return {
        "scene": "a <scene>",
        "triangles": 1234,
        "objects": 5,
        "dynamic": True,
        "texels": 900,
        "valid": 800,
        "baseline": "round-robin",
        "full": "influence",
        "options": options,
        "command": "lightloom policies scene",
        "key_frames": KEY_FRAMES,
        "timeline_frames": [4, 7],
        "rays_an_update": 20,
        "policies": policies,
        "parameters": [
            {"name": "facing_slack", "value": 0.0625, "range": (0.0, 1.0), "choices": None, "meaning": "Below."},
            {"name": "influence", "value": "volumes", "range": None, "choices": ("off", "volumes"), "meaning": "How."},
            {"name": "shadows", "value": True, "range": None, "choices": None, "meaning": "Whether."},
        ],
        "error_scale": {"range": 0.5, "floor": 0.05, "colours": ["#000000", "#ffffff"]},
        "quantities": [
            {"name": "priority", "title": "Priority", "about": "Class.", "low": 0, "high": 15, "unit": "class"}
            | {"labels": [], "colours": ["#000000", "#ffffff"], "open": True},
            {"name": "degree", "title": "Visibility", "about": "Degree.", "low": 0, "high": 1, "unit": ""}
            | {"labels": ["hidden", "seen"], "colours": ["#000000", "#ffffff"], "open": False},
        ],
        "exposure": 1.0,
        "few_counted": None,
        "reference": {"rays": 512, "every": 2, "frames": [0, 2, 4, 6, 8], "noise": 0.0071}
        | {"true_samples": 0, "true_frame": None},
        "versions": {"python": "3"},
        "machine": {"processor": "p", "cores": 2, "system": "s", "architecture": "a"},
        "seconds": {"Charts": 1.0},
    }


def test_page_says_what_the_figures_say(tmp_path: Path) -> None:
    page = Page(policies_page(made_up(tmp_path), tmp_path))
    words = " ".join(page.text.split())
    for text in ("a <scene>", "0.25\N{MULTIPLICATION SIGN} the error of round-robin", "5 % instead of 20 %", "0.71 %"):
        assert text in words
    for text in (
        "About influence <&>.",
        "facing_slack",
        "0.0625",
        "0 to 256",
        "off, volumes",
        "yes, no",
        "15+",
        "hidden",
        "1,234",
        "0.012",
    ):
        assert text in words
    assert words.count("exceeded") == 1 + 1  # the policy that did, and the sentence that says that none does
    assert words.count("kept") == 2


def test_page_has_what_a_path_traced_picture_says(tmp_path: Path) -> None:
    report = made_up(tmp_path)
    words = " ".join(Page(policies_page(report, tmp_path)).text.split())
    assert "E true" not in words
    assert "> 17" in words
    report["reference"] |= {"true_samples": 1024, "true_frame": 88}
    words = " ".join(Page(policies_page(report, tmp_path)).text.split())
    assert "E true is that of frame 88" in words
    assert "with 1,024 paths a pixel, whose own noise is 0.11 %" in words
    assert "3.21 %0.987" in words


def test_page_says_where_few_pixels_count(tmp_path: Path) -> None:
    report = made_up(tmp_path)
    assert "Note:" not in Page(policies_page(report, tmp_path)).text
    said = "frame 4: errors are those of 3 % of the pixels"
    assert f"Note: {said}." in Page(policies_page(report | {"few_counted": said}, tmp_path)).text


def test_page_needs_nothing_else(tmp_path: Path) -> None:
    page = Page(policies_page(made_up(tmp_path), tmp_path))
    assert page.links
    assert all(link.startswith("data:image/") for link in page.links)
    # The film; at each key frame the reference and two a policy; each quantity at each key frame and as maps.
    assert len(page.links) == 1 + 2 * (1 + 2 * 3) + 2 * (2 + 1)
    assert not {"script", "link", "iframe"} & set(page.tags)


def test_page_of_one_policy_and_a_black_reference(tmp_path: Path) -> None:
    report = made_up(tmp_path)
    report["policies"] = report["policies"][-1:]
    report["baseline"] = "influence"
    report["reference"]["noise"] = None
    (policy,) = report["policies"]
    policy["changes"], policy["before"] = [], None
    policy["summary"] |= dict.fromkeys(("error", "error_ratio", "worst_error", "relative_mse", "relative_mse_ratio"))
    for row in policy["frames"]:
        if "error" in row:
            row["error"] = None
    words = " ".join(Page(policies_page(report, tmp_path)).text.split())
    assert "\N{EN DASH} mean error" in words
    assert "own error" not in words


def test_line_chart() -> None:
    series: dict[str, list[float | None]] = {"a": [1.0, None, 3.0, 2.0], "b <": [4.0, 4.0, 4.0, 4.0]}
    svg = ET.fromstring(line_chart([0, 2, 4, 6], series, marks=[4], number=lambda value: f"{value:.0f} %"))
    lines = [line for line in svg.iter("polyline") if line.get("class") == "c0"]
    places = [[tuple(map(float, pair.split(","))) for pair in line.get("points", "").split()] for line in lines]
    assert [len(line) for line in places] == [1, 2]  # the gap parts the line
    (first,), (second, third) = places
    assert first[0] < second[0] < third[0]
    assert second[1] < third[1] < first[1]  # greater is higher
    (mark,) = (line for line in svg.iter("line") if line.get("class") == "mark")
    assert float(mark.get("x1", "")) == second[0]
    names = {text.text: float(text.get("y", "")) for text in svg.iter("text") if "label" in text.get("class", "")}
    assert set(names) == {"a", "b <"}
    assert "a, frame 4: 3 %" in [title.text for title in svg.iter("title")]


def test_names_of_lines_that_end_together_stand_apart() -> None:
    svg = ET.fromstring(line_chart([0, 1], {name: [1.0, 0.0] for name in "abcde"}))
    heights = sorted(float(text.get("y", "")) for text in svg.iter("text") if "label" in text.get("class", ""))
    assert min(np.diff(heights)) >= 12


@pytest.mark.parametrize("last", [0, 1, 7, 48, 95, 600])
def test_frames_below_a_chart_are_whole_numbers(last: int) -> None:
    svg = ET.fromstring(line_chart(list(range(last + 1)), {"a": [0.5] * (last + 1)}))
    frames = [text.text or "" for text in svg.iter("text") if text.get("text-anchor") == "middle"]
    assert all(frame.isdecimal() and int(frame) <= last for frame in frames)
    assert 1 <= len(frames) <= 13


def test_wording() -> None:
    assert [percent(x) for x in (0.1234, 1.0, None)] == ["12.3 %", "100 %", "\N{EN DASH}"]
    assert [times(x) for x in (0.412, None)] == ["0.41\N{MULTIPLICATION SIGN}", "\N{EN DASH}"]
    assert [setting(x) for x in (True, 0.0625, (1, 3, 6), "volumes")] == ["yes", "0.0625", "1 3 6", "volumes"]
    policies = [{"name": name, "summary": {"machine_seconds": time}} for name, time in (("a", 0.001), ("b", 0.0025))]
    assert frame_times(policies) == "1 ms with a, 2.5 ms with b"
    assert code("with `a < b`, so") == "with <code>a &lt; b</code>, so"
