"""A fingerprint of a module and of all that it imports from this package: results kept on disk are named after it."""

import ast
import hashlib
from functools import cache
from pathlib import Path

PACKAGE = __name__.partition(".")[0]
ROOT = Path(__file__).parents[__name__.count(".")]
"""The folder that the package lies in."""


@cache
def fingerprint(module: str, root: Path = ROOT) -> str:
    """16 hexadecimal digits of the texts of `sources(module)` and of their names (SHA-256)."""
    digest = hashlib.sha256()
    for name, path in sorted(sources(module, root).items()):
        text = path.read_bytes()
        digest.update(f"{name} {len(text)}\n".encode() + text)
    return digest.hexdigest()[:16]


def sources(module: str, root: Path = ROOT) -> dict[str, Path]:
    """The files that a module of this package is made of, by the names of their modules.

    These are its own, those of the packages that it lies in, and of every module of ours that one of them imports, at
    its top or inside of a function; `root` is the folder that the package lies in. What is imported by a name that is
    made at run time is not seen, nor is a relative import: there are none here. ModuleNotFoundError where there is no
    such module.
    """
    found: dict[str, Path] = {}
    waiting = [module]
    while waiting:
        name = waiting.pop()
        path = _file_of(name, root)
        if name in found or path is None:
            continue
        found[name] = path
        parents = (name.rsplit(".", depth)[0] for depth in range(1, name.count(".") + 1))
        waiting += [*parents, *_imported(path.read_bytes())]
    if module not in found:
        raise ModuleNotFoundError(f"{module}: no file of it in {root}")
    return found


def _file_of(name: str, root: Path) -> Path | None:
    """The file of a module of this package; None for one of another package, and for what is no module."""
    place = root.joinpath(*name.split("."))
    files = (place / "__init__.py", place.with_suffix(".py"))
    return next((path for path in files if path.is_file()), None) if name.partition(".")[0] == PACKAGE else None


@cache
def _imported(text: bytes) -> tuple[str, ...]:
    """The names in the imports of a source text: of modules, and of what may be one (b in `from a import b`)."""
    names: list[str] = []
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            names += [str(node.module), *(f"{node.module}.{alias.name}" for alias in node.names)]
    return tuple(names)
