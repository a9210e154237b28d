"""A case of the suite: one layout at one budget from one seed, compared under policies, and kept.

All of a case, its figures, page, film and scene, is in one folder, which is named after all that they depend on. So
what is shown side by side was computed together, whatever was computed in between.
"""

import json
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from lightloom.golden_model.charts.curved import default_cache
from lightloom.golden_model.charts.unwrap import unwrap
from lightloom.golden_model.host.fingerprint import fingerprint
from lightloom.golden_model.host.outputs import whole_folder
from lightloom.golden_model.scene.files.load import load_scene
from lightloom.golden_model.stimuli.layouts.catalogue import BUDGETS, LAYOUTS, SEEDS, write_layout
from lightloom.golden_model.structures.structure import Structure
from lightloom.policies.comparison import write_comparison
from lightloom.policies.options import Comparison
from lightloom.policies.report import TRUE
from lightloom.shared.console import Progress
from lightloom.shared.step_cache import key_of
from lightloom.sim.toolchain import locked

CASES = "cases"
"""The folder of the cases' folders."""
REFERENCES = "references"
"""The folder of converged maps, which both budgets of a layout and seed have in common."""
FIGURES = (
    *("error", "worst_error", "energy", "flip", "jump", "darkened", "missed"),
    *("lag", "lag_turns", "lags", "never_shown", "oldest", "unknown", "least_share", "greatest_share"),
    *TRUE,
)
"""What the suite takes of the summary of each policy."""


@dataclass(frozen=True)
class Case:
    """A layout with a seed and a budget; the seed is also that of the renders."""

    layout: str
    budget: str
    seed: int

    @property
    def name(self) -> str:
        return f"{self.layout}-{self.budget}-{self.seed}"

    def folder(self, options: Comparison) -> str:
        """Where all of the case is, relative to the suite's folder: named after the program, the options and itself."""
        return f"{CASES}/{self.name}-{key_of(fingerprint(__name__), repr(options), self.name)}"


def cases(layouts: Iterable[str] = LAYOUTS, seeds: Iterable[int] = SEEDS) -> list[Case]:
    """Of each layout each budget and seed."""
    return [Case(layout, budget, seed) for layout in layouts for budget in BUDGETS for seed in seeds]


def run_case(case: Case, options: Comparison, suite: Path) -> dict[str, Any]:
    """The figures of a case, computed now or before, and `page`, its folder in the folder `suite`."""
    page = case.folder(options)
    with locked(suite / page):  # parallel runs compute it once
        if not (suite / page).exists():
            _compute(case, options, suite / page, suite / REFERENCES)
        report = json.loads((suite / page / "policies.json").read_text(encoding="utf-8"))
    policies = {each["name"]: {name: each["summary"][name] for name in FIGURES} for each in report["policies"]}
    return {**asdict(case), "rays": BUDGETS[case.budget], "valid": report["valid"], "policies": policies, "page": page}


def _compute(case: Case, options: Comparison, place: Path, references: Path) -> None:
    with whole_folder(place) as folder:
        file = write_layout(case.layout, case.seed, folder)
        scene = load_scene(file)
        own = {"scene": str(place / file.name), "budget": BUDGETS[case.budget], "seed": case.seed}
        comparison = Comparison(**asdict(options) | own)
        lightmaps = unwrap(scene, trace=Structure(scene, options.backend).trace, cache=default_cache())
        write_comparison(scene, lightmaps, comparison, folder, Progress(quiet=True), references)
