"""The import rule between the rooms, and what else holds for every file."""

import ast
import re
from pathlib import Path

import pytest

from tests import ROOT

# What each room may import of our own; a trailing part narrows it (`rtl` may use the model's tables, not its renderer).
MODEL_TABLES = {"lightloom.golden_model.contract.formats", "lightloom.golden_model.contract.interfaces"}
MAY_IMPORT = {
    "golden_model": {"golden_model"},
    "rtl": {"rtl"} | MODEL_TABLES,
    "gen": {"gen", "rtl", "golden_model"},
    "sim": {"sim", "gen", "lightloom.rtl.config", "golden_model", "lightloom.verif.bins.coverage"},
    "verif": {"verif", "golden_model"},
    "lightloom": {"lightloom", "golden_model", "rtl", "gen", "sim", "verif"},
    "tests": {"tests", "lightloom", "golden_model", "rtl", "gen", "sim", "verif"},
}


def own_imports(path: Path) -> list[str]:
    """Dotted names of our own modules that a file imports, `from a import b` as both a and a.b where b is a module."""
    names: list[str] = []
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module and node.level == 0:
            modules = [f"{node.module}.{alias.name}" for alias in node.names]
            found = [name for name in modules if (ROOT / name.replace(".", "/")).with_suffix(".py").exists()]
            names += found or [node.module]
    return [name for name in names if name.split(".")[0] in MAY_IMPORT]


def sources(room: str) -> list[Path]:
    return sorted((ROOT / room).rglob("*.py"))


@pytest.mark.parametrize("room", MAY_IMPORT)
def test_imports_follow_the_order_of_the_rooms(room: str) -> None:
    assert sources(room), f"{room} has no sources"
    wrong = [
        f"{path.relative_to(ROOT)} imports {name}"
        for path in sources(room)
        for name in own_imports(path)
        if not any(name == allowed or name.startswith(allowed + ".") for allowed in MAY_IMPORT[room])
    ]
    assert not wrong, "\n".join(wrong)


def test_every_unit_has_its_name_in_every_room() -> None:
    from lightloom.golden_model.contract.interfaces import ALL, OPERATORS, UNITS
    from lightloom.golden_model.models import MODELS
    from lightloom.rtl.catalogue import CATALOGUE

    assert set(CATALOGUE) == set(ALL)
    assert set(MODELS) == set(UNITS)
    for unit in UNITS:
        if unit in OPERATORS:
            assert (ROOT / "rtl" / "operators" / f"{unit}.py").exists()
        else:
            function = MODELS[unit].__name__  # units of one function share their files
            assert (ROOT / "rtl" / f"{function}.py").exists()
            assert (ROOT / "golden_model" / f"{function}.py").exists()
            assert (ROOT / "verif" / f"test_{unit}.py").exists()


def test_every_signal_has_a_line_of_its_own() -> None:
    # Amaranth names a signal by the line that makes it; of several in one line, only the last gets its name.
    wrong = [
        f"{path.relative_to(ROOT)}:{node.lineno}"
        for path in sources("rtl")
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Assign) and isinstance(node.value, ast.Tuple)
        if any(re.match(r"Signal\((?!.*name=)|.*_port\(", ast.unparse(value)) for value in node.value.elts)
    ]
    assert not wrong, "\n".join(wrong)


# Results that depend on the host's processor or libraries have no place in the model's arithmetic.
HOST_DEPENDENT = re.compile(
    r"np\.(dot|matmul|einsum|inner|vdot|tensordot|sin|cos|tan|exp|exp2|log|log2|log10|power)\(|fastmath=True| @ "
)


def test_model_arithmetic_does_not_depend_on_the_host() -> None:
    # Pictures for the eye are outside the contract: `images.py` says so.
    wrong = [
        f"{path.relative_to(ROOT)}:{number}: {line.strip()}"
        for path in sources("golden_model")
        if path.name != "images.py"
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1)
        if HOST_DEPENDENT.search(line)
    ]
    assert not wrong, "\n".join(wrong)
