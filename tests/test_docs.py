"""The examples in README.md and docs/ run."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests import ROOT

PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md"))]
EXAMPLE = re.compile(r"^```python\n(.*?)^```", re.MULTILINE | re.DOTALL)
EXAMPLES = [
    pytest.param(example, id=f"{page.name}-{number}")
    for page in PAGES
    for number, example in enumerate(EXAMPLE.findall(page.read_text(encoding="utf-8")))
]


@pytest.mark.parametrize("example", EXAMPLES)
def test_python_example(example: str, tmp_path: Path) -> None:
    env = {**os.environ, "LIGHTLOOM_CACHE": str(ROOT / "build" / "sim")}
    run = [sys.executable, "-W", "error", "-c", example]
    done = subprocess.run(run, cwd=tmp_path, env=env, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_lead_somewhere(page: Path) -> None:
    for target in re.findall(r"\]\(([^)#]+)(?:#[^)]*)?\)", EXAMPLE.sub("", page.read_text(encoding="utf-8"))):
        if not target.startswith("https://"):
            assert (page.parent / target).exists(), f"{page.name}: {target}"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_files_that_are_named_exist(page: Path) -> None:
    rooms = "golden_model|rtl|gen|sim|verif|lightloom|tests|docs|scenes"
    named = set(re.findall(rf"`((?:{rooms})/[a-z0-9_/.-]+)(?:::\w+)?`", page.read_text(encoding="utf-8")))
    there = {name for name in named if (ROOT / name).exists() or (ROOT / f"{name}.py").exists()}
    assert sorted(named - there) == []


ARCHITECTURE = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
WALKS = re.findall(r"^## (A .*|The same .*)\n((?:(?!^## ).*\n)+)", ARCHITECTURE, re.M)


@pytest.mark.parametrize(("name", "walk"), WALKS, ids=[name for name, _ in WALKS])
def test_a_walk_enters_no_folder_twice(name: str, walk: str) -> None:
    files = [Path(file) for file in re.findall(r"`(\w+/[\w/]+\.py)`", walk)]
    assert len(files) >= 4, name
    assert [str(file) for file in files if not (ROOT / file).exists()] == []
    folders = [files[0].parent]
    for file in files:
        if file.parent != folders[-1]:
            folders.append(file.parent)
    assert len(folders) == len(set(folders)), [str(folder) for folder in folders]
