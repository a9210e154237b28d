"""What the files of the checkout import of ours, as their text says: for the rules of `tests/test_rooms.py`."""

import ast
from collections.abc import Sequence
from functools import cache
from pathlib import Path

from tests import ROOT

ROOMS = ("golden_model", "rtl", "gen", "sim", "verif")
"""Folders of the checkout, and links to them in lightloom/."""


@cache
def modules() -> dict[str, Path]:
    """Every module of ours by the name that it is imported by, without those of tests."""
    found = {}
    for folder in (*ROOMS, "lightloom"):
        for path in sources(folder):
            parts = path.relative_to(ROOT).with_suffix("").parts
            parts = parts[:-1] if parts[-1] == "__init__" else parts
            found[".".join(parts if folder == "lightloom" else ("lightloom", *parts))] = path
    return found


def sources(folder: str) -> list[Path]:
    """The files of a folder of the checkout; rooms are not found a second time behind their links."""
    links = {ROOT / "lightloom" / room for room in ROOMS}
    return [path for path in sorted((ROOT / folder).rglob("*.py")) if links.isdisjoint(path.parents)]


@cache
def syntax(path: Path) -> ast.Module:
    """The text of a file, as it is parsed."""
    return ast.parse(path.read_text(encoding="utf-8"))


@cache
def nodes(path: Path) -> tuple[ast.AST, ...]:
    """All of `syntax`, in no order: most of the time of a rule is the walk, so it is made once."""
    return tuple(ast.walk(syntax(path)))


@cache
def own_imports(path: Path) -> frozenset[str]:
    """The modules of ours that a file imports, anywhere in it, and those that it names in a string.

    A string that is a module's name is for `import_module`, for `python -m` or for a simulator. Ways to a module that
    begin with an import of another one are what `defined_elsewhere` finds.
    """
    names = set()
    for node in nodes(path):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: a relative import"
            whole = {f"{node.module}.{alias.name}" for alias in node.names}
            names |= {name if name in modules() else str(node.module) for name in whole}
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and "." in node.value:
            names.add(node.value)
    return frozenset(name for name in names if name in modules())


def asked_for(node: ast.AST) -> set[str]:
    """The modules that a call of `import_module` or `__import__` asks for by a name that is written there."""
    if not isinstance(node, ast.Call) or ast.unparse(node.func).split(".")[-1] not in ("import_module", "__import__"):
        return set()
    given = [*node.args[:1], *(one.value for one in node.keywords if one.arg == "name")]
    return {one.value for one in given if isinstance(one, ast.Constant) and isinstance(one.value, str)}


@cache
def own_names(module: str) -> frozenset[str]:
    """What a module of ours has at its top that is no import, also below `if` and `try`."""
    names: set[str] = set()
    waiting: list[ast.AST] = [syntax(modules()[module])]
    while waiting:
        node = waiting.pop()
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            names.add(node.name)
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            names.add(node.id)
        else:
            waiting += ast.iter_child_nodes(node)
    return frozenset(names)


def dotted(node: ast.AST) -> str:
    """A name or a chain of attributes of one, as it is written; "" for anything else."""
    if isinstance(node, ast.Attribute):
        return f"{before}.{node.attr}" if (before := dotted(node.value)) else ""
    return node.id if isinstance(node, ast.Name) else ""


def defined_elsewhere(text: Sequence[ast.AST]) -> list[str]:
    """What a file, given by its nodes, takes of modules of ours that is not theirs: folders, and what they import.

    `import a.b as c` and `from a import b` give the file a module, of which it may then take `c.name`; where that is
    a module again, or a name that c imports, an arrow leads to where it comes from that no import shows.
    """
    bound: dict[str, str] = {}
    wrong = []
    for node in text:
        if isinstance(node, ast.Import):
            bound |= {alias.asname or alias.name: alias.name for alias in node.names if alias.name in modules()}
        elif isinstance(node, ast.ImportFrom) and node.module in modules():
            for alias in node.names:
                if (whole := f"{node.module}.{alias.name}") in modules():
                    bound[alias.asname or alias.name] = whole
                elif alias.name not in own_names(node.module):
                    wrong.append(whole)
    wrong += [name for name in bound.values() if modules()[name].name == "__init__.py"]
    for node in text:
        if not isinstance(node, ast.Attribute) or node.attr.startswith("__"):
            continue
        if (module := bound.get(dotted(node.value))) and node.attr not in own_names(module):
            wrong.append(f"{module}.{node.attr}")
    return wrong
