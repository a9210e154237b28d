"""The page docs/suite.md and the figures beside it, docs/suite.json, of a run of the suite.

`python -m lightloom.pages.suite build/suite/suite.json` writes both.
"""

import json
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from lightloom.gen.pages.suite_page import columns_of, markdown_table
from lightloom.pages.results import table
from lightloom.policies.bars import WHOLE, bars
from lightloom.policies.suite import geometric_means
from lightloom.policies.suite import table as rows_of
from lightloom.shared.provenance import commands_at

DOCS = Path(__file__).parents[2] / "docs"
KEPT = ("command", "policies", "cases", "versions", "machine")
"""What pages keep of a suite.json beside them; the rest is made of it."""

PREAMBLE = """\
# The suite, measured

<!-- Made by `python -m lightloom.pages.suite build/suite/suite.json`. -->

What each layout of the [suite](policies.md#the-suite) came to, the worst first: {count} of {whole} cases (layouts,
budgets and seeds). A later change of the model is held against it: `--before docs/suite.json`.

{commands}

{machine}

E is against converged maps of the same frame and build. Its geometric mean over layouts and budgets, to that of
{first}: {means}. The other columns are of {last}:

{meanings}
"""


def page(report: Mapping[str, Any]) -> str:
    """The whole page, of what docs/suite.json holds."""
    rows = rows_of(report["cases"])
    names = report["policies"]
    means = ", ".join(f"{name} {mean:.3f}" for name, mean in geometric_means(rows).items() if name != names[0])
    preamble = PREAMBLE.format(
        count=len(report["cases"]),
        whole=WHOLE,
        commands=commands_at([(report["command"], report["versions"])]),
        machine=f"{report['machine']['processor']}, {report['machine']['cores']} cores.",
        first=names[0],
        last=names[-1],
        means=means,
        meanings="\n".join(f"- {column.name}: {column.about}" for column in columns_of(rows)),
    )
    before = json.loads((DOCS / "suite-baseline.json").read_text(encoding="utf-8"))
    held = [(bar.name, bar.shown, bar.wanted, "yes" if bar.met else "no", bar.where) for bar in bars(report, before)]
    return "\n".join(
        [
            preamble,
            *markdown_table(rows),
            "\n## Bars\n\nWhat `--bars --before docs/suite-baseline.json` says of it, rounded to the worse side.\n",
            table(("bar", "figure", "limit", "met", "where"), held),
            "",
        ]
    )


def write(report: Mapping[str, Any], docs: Path = DOCS) -> None:
    """Writes suite.json and suite.md into a folder, of what a suite.json holds."""
    write_page("suite", page, report, docs)


def write_page(name: str, make: Callable[[Mapping[str, Any]], str], report: Mapping[str, Any], docs: Path) -> None:
    """Writes NAME.json, what is kept of a suite.json, and NAME.md, which `make` makes of that, into a folder."""
    kept = {field: report[field] for field in KEPT}
    (docs / f"{name}.json").write_text(json.dumps(kept, separators=(",", ":")) + "\n", encoding="utf-8")
    (docs / f"{name}.md").write_text(make(kept), encoding="utf-8")


if __name__ == "__main__":
    write(json.loads(Path(sys.argv[1]).read_text(encoding="utf-8")))
