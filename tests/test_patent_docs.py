"""docs/patent.md names what there is, modules, options, tests and films, and leaves no paragraph and no claim out."""

import ast
import dataclasses
import importlib
import re
from functools import cache

from lightloom.rtl.catalogue import CATALOGUE
from tests import ROOT

PAGE = (ROOT / "docs" / "patent.md").read_text(encoding="utf-8")
OPTIONS = set(re.findall(r"^  (--[\w-]+)", (ROOT / "docs" / "command-line.md").read_text(encoding="utf-8"), re.M))

NOTHING_TO_BUILD = {*range(1, 5), *range(13, 33), 37, *range(92, 101)}
"""Of the paragraphs 1 to 100: introduction, list of figures, overview, what words mean."""


def rows() -> list[list[str]]:
    """The cells of all rows of the page's tables, without their heads."""
    tables = re.findall(r"^\|.*\|\n\|[-|]+\|\n((?:\|.*\|\n)+)", PAGE, re.M)
    return [[cell.strip() for cell in row.strip("|").split("|")] for table in tables for row in table.splitlines()]


def named(column: int) -> list[str]:
    """What a column names in backticks, everywhere on the page, each once."""
    return sorted({name for row in rows() for name in re.findall(r"`([^`]+)`", row[column])})


@cache
def functions(test: str) -> set[str]:
    """Names of the test functions in all files tests/**/TEST.py."""
    files = sorted((ROOT / "tests").rglob(f"{test}.py"))
    return {
        node.name
        for file in files
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8")))
        if isinstance(node, ast.FunctionDef)
    }


def expanded(text: str) -> set[int]:
    """Paragraph numbers, with what lies between "[0001] to [0003]"."""
    found = set()
    for first, last in re.findall(r"\[(\d{4})\](?: to \[(\d{4})\])?", text):
        found |= set(range(int(first), int(last or first) + 1))
    return found


def test_every_row_has_all_columns() -> None:
    assert len(rows()) > 60
    for row in rows():
        assert len(row) == 5, row
        assert all(row[column] for column in (0, 1, 2, 4)), row


def test_modules_exist() -> None:
    found = [any((ROOT / room / f"{name}.py").exists() for room in (".", "golden_model")) for name in named(2)]
    assert [name for name, there in zip(named(2), found, strict=True) if not there] == []


def test_switches_exist() -> None:
    options = [name for name in named(3) if name.startswith("--")]
    assert [name for name in options if name not in OPTIONS] == []
    fields = [name.split(".") for name in named(3) if name not in options]
    assert [f"{owner}.{field}" for owner, field in fields if field not in fields_of(owner)] == []


@cache
def fields_of(owner: str) -> set[str]:
    """Of the dataclass of that name in golden_model."""
    for path in sorted((ROOT / "golden_model").rglob("*.py")):
        if re.search(rf"^class {owner}\b", path.read_text(encoding="utf-8"), re.M):
            module = ".".join(("lightloom", *path.relative_to(ROOT).with_suffix("").parts))
            kind = getattr(importlib.import_module(module), owner)
            return {item.name for item in dataclasses.fields(kind)}
    return set()


def test_tests_exist() -> None:
    tests = [name.split("::") for name in named(4)]
    assert [f"{file}::{function}" for file, function in tests if function not in functions(file)] == []


def test_films_exist() -> None:
    seen = re.findall(r"^Seen in: ((?:.|\n)*?)\n\n", PAGE, re.M)
    films = {film for part in seen for film in re.findall(r"\*([\w-]+)\*", part)}
    assert len(films) >= 6
    assert [film for film in films if not (ROOT / "scenes" / f"{film}.toml").exists()] == []


def test_no_paragraph_is_left_out() -> None:
    in_rows = set().union(*(expanded(row[0]) for row in rows()))
    assert sorted(set(range(1, 101)) - NOTHING_TO_BUILD - in_rows) == []
    assert expanded(PAGE[PAGE.index("**Nothing to build**") :]) == NOTHING_TO_BUILD


def test_every_claim_has_one_row() -> None:
    claims = PAGE[PAGE.index("## Claims") : PAGE.index("## What is not done")]
    assert [int(number) for number in re.findall(r"^\| (\d+) \|", claims, re.M)] == list(range(1, 21))


def test_units_that_exist_are_counted() -> None:
    assert len(CATALOGUE) == 23
    assert "Verilog-2001 of the twenty-three units that exist" in PAGE


def test_what_the_code_cites_is_on_the_page() -> None:
    """Every paragraph that a docstring or comment of the golden model names."""
    code = "\n".join(path.read_text(encoding="utf-8") for path in sorted((ROOT / "golden_model").rglob("*.py")))
    assert sorted(expanded(code) - expanded(PAGE)) == []
