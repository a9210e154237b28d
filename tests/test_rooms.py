"""The import rules: one name a module, rooms that look down only, no circles; and what else holds for all files.

`docs/architecture.md` and CONTRIBUTING.md tell what the rooms are for.
"""

import ast
import re
import subprocess
import sys
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from graphlib import CycleError, TopologicalSorter
from importlib import import_module
from pathlib import Path

import pytest

from lightloom.golden_model.contract.interfaces import OPERATORS, PURE, UNITS
from lightloom.golden_model.models import MODELS
from lightloom.golden_model.numerics import floats
from lightloom.rtl.catalogue import CATALOGUE
from lightloom.rtl.config import PLACES, PRESETS
from lightloom.rtl.fabric.pipeline import StreamUnit
from tests import ROOT
from tests.imports import ROOMS, asked_for, defined_elsewhere, modules, nodes, own_imports, sources

# What each room may import of ours, without "lightloom."; a part after a dot narrows it.
MAY_IMPORT = {
    "golden_model": {"golden_model"},
    "rtl": {"rtl", "golden_model.contract", "golden_model.host.errors", "golden_model.host.parameters"},
    "gen": {"gen", "rtl", "golden_model"},
    "sim": {"sim", "gen", "rtl.config", "golden_model", "verif.bins.coverage", "verif.benches"},
    "verif": {"verif", "golden_model"},
}

FLOORS: dict[str, tuple[set[str], ...]] = {
    "golden_model": (
        {"renderer", "oracle", "models"},
        {"driver"},
        {"frame", "charts", "stimuli"},
        {"structures", "pictures"},
        {"scene"},
        {"engine", "machine"},
        {"tracing", "rays"},
        {"tables"},
        {"numerics"},
        {"contract", "host"},
    ),
    "rtl": (
        {"buses"},
        {"catalogue"},
        {"traversal", "engine"},
        {"intersection", "memory", "registers"},
        {"operators"},
        {"fabric"},
        {"config"},
        {"blocks"},
    ),
}
"""What lies in a room, by floors, the top first: an arrow leads from a floor to a lower one."""


def arrows(inside: str, child: Callable[[str], str | None]) -> dict[str, set[str]]:
    """Which children of a package import which others; `child` tells the child that a module belongs to."""
    graph: dict[str, set[str]] = {}
    for name, path in modules().items():
        if name.startswith(f"{inside}.") and (mine := child(name)):
            graph.setdefault(mine, set()).update(
                other for used in own_imports(path) if (other := child(used)) and other != mine
            )
    return graph


def child_of(package: str) -> Callable[[str], str | None]:
    """To the name of a module the file or folder, of those that lie in `package`, that it is or belongs to."""
    return lambda name: name[len(package) + 1 :].split(".")[0] if name.startswith(f"{package}.") else None


def circle(graph: dict[str, set[str]]) -> list[str]:
    """A circle in a graph; [] where there is none."""
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        return list(error.args[1])
    return []


PACKAGES = sorted({name.rpartition(".")[0] for name in modules()} - {""})


def test_there_is_something_to_look_at() -> None:
    assert set(MAY_IMPORT) == set(ROOMS)
    assert len(modules()) > 250
    assert {"lightloom", "lightloom.rtl.traversal", "lightloom.golden_model.scene.files.toml"} <= set(PACKAGES)
    assert sum(len(own_imports(path)) for path in modules().values()) > 1000


@pytest.mark.parametrize(
    "text",
    [
        "import lightloom.golden_model as g\ng.host.errors.InputError",
        "import lightloom.golden_model.host\nlightloom.golden_model.host.errors",
        "from lightloom import rtl\nrtl.catalogue.CATALOGUE",
        "from lightloom.gen import emit\nemit.CATALOGUE",
        "import lightloom.gen.emit as e\nclass A(e.Config): pass",
        "from lightloom.gen.emit import CATALOGUE as units",
        "from lightloom.gen.emit import *",
    ],
)
def test_ways_round_the_imports_are_noticed(text: str) -> None:
    assert defined_elsewhere(list(ast.walk(ast.parse(text))))


def test_what_a_module_has_itself_may_be_taken_by_any_way() -> None:
    ways = ("import lightloom.gen.emit as e\ne.INDEXED, e.emit", "from lightloom.gen import emit\nemit.emit")
    assert [
        defined_elsewhere(list(ast.walk(ast.parse(way)))) for way in (*ways, "from lightloom.gen.emit import emit")
    ] == [[], [], []]


def test_every_import_names_the_file_that_has_what_is_taken() -> None:
    """Then the imports are all arrows that there are, and the tests below see them."""
    taken = {path.relative_to(ROOT): defined_elsewhere(nodes(path)) for path in modules().values()}
    wrong = [f"{path} takes {', '.join(names)}" for path, names in taken.items() if names]
    assert not wrong, "\n".join(wrong)


@pytest.mark.parametrize("room", ROOMS)
def test_imports_follow_the_order_of_the_rooms(room: str) -> None:
    allowed = tuple(f"lightloom.{name}" for name in MAY_IMPORT[room])
    wrong = [
        f"{path.relative_to(ROOT)} imports {name}"
        for path in sources(room)
        for name in own_imports(path)
        if not any(name == one or name.startswith(f"{one}.") for one in allowed)
    ]
    assert not wrong, "\n".join(wrong)


@pytest.mark.parametrize("room", FLOORS)
def test_no_import_climbs(room: str) -> None:
    """Every file and folder of the room has a floor, and imports between them lead downwards."""
    package = f"lightloom.{room}"
    floor = {name: number for number, names in enumerate(FLOORS[room]) for name in names}
    graph = arrows(package, child_of(package))
    assert set(graph) == set(floor)
    wrong = [f"{one} imports {other}" for one in graph for other in graph[one] if floor[other] <= floor[one]]
    assert not wrong, "\n".join(wrong)


def test_no_file_is_in_a_circle() -> None:
    assert circle({name: set(own_imports(path)) - {name} for name, path in modules().items()}) == []


@pytest.mark.parametrize("package", PACKAGES)
def test_no_folder_is_in_a_circle(package: str) -> None:
    """Of the files and folders of one folder none imports, by whatever way, what imports it."""
    assert circle(arrows(package, child_of(package))) == []


BARE = re.compile(rf"(?:^|[\"';:]|\\n)\s*(?:from|import)\s+(?:\w+,\s*)*(?:{'|'.join(ROOMS)})\b", re.M)


def roots(path: Path) -> set[str]:
    """The first names of everything that a file imports, anywhere in it, also by a string that looks like a module."""
    found = set()
    for node in nodes(path):
        if isinstance(node, ast.Import):
            found |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            found.add(str(node.module).split(".")[0])
        else:
            found |= {name.split(".")[0] for name in asked_for(node)}
    return found


def test_no_file_imports_a_room_by_its_bare_name() -> None:
    """It would be a second copy of the module, with constants and types of its own."""
    code = [*modules().values(), *sources("tests"), *sources("examples"), *ROOT.glob(".ci/*.py")]
    assert [str(path.relative_to(ROOT)) for path in code if roots(path) & set(ROOMS)] == []
    texts = [*ROOT.glob("*.md"), *ROOT.glob("docs/*.md"), *code]
    assert [str(path.relative_to(ROOT)) for path in texts if BARE.search(path.read_text(encoding="utf-8"))] == []


def test_what_is_shipped_imports_no_test() -> None:
    assert [str(path.relative_to(ROOT)) for path in modules().values() if "tests" in roots(path)] == []


def test_no_process_holds_a_module_twice() -> None:
    program = (
        "import importlib, os, pkgutil, sys\n"
        "import lightloom\n"
        "for found in pkgutil.walk_packages(lightloom.__path__, 'lightloom.'):\n"
        "    importlib.import_module(found.name)\n"
        f"bare = [name for name in sys.modules if name.split('.')[0] in {ROOMS!r}]\n"
        "files = [os.path.realpath(m.__file__) for n, m in sys.modules.items() if n.split('.')[0] == 'lightloom']\n"
        "assert not bare, bare\n"
        "assert len(files) == len(set(files)), 'a file was imported twice'\n"
        "print(len(files))\n"
    )
    done = subprocess.run([sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert int(done.stdout) == len(modules())


def test_the_rooms_are_linked_into_the_package() -> None:
    for room in ROOMS:
        assert (ROOT / "lightloom" / room).readlink() == Path("..") / room


def found(room: str, name: str) -> Iterable[Path]:
    return (ROOT / room).rglob(f"{name}.py")


def test_every_unit_has_its_name_in_every_room() -> None:
    assert list(CATALOGUE) == list(UNITS)
    assert set(MODELS) == set(UNITS)
    for unit in UNITS:
        made = CATALOGUE[unit](PRESETS["base"])
        assert made.unit is UNITS[unit]
        hardware = type(made.core if isinstance(made, StreamUnit) else made).__module__
        assert list(found("rtl", hardware.rpartition(".")[2]))
        if unit in OPERATORS:
            assert hardware.endswith(f".operators.{unit}")
            assert hasattr(floats, unit)
        elif unit in PURE:  # a file may have two units of one function
            assert unit.startswith(hardware.rpartition(".")[2])
            assert list(found("golden_model", hardware.rpartition(".")[2]))
        known = {place for block, field in PLACES.values() for place in (block, f"{block}.{field}")}
        assert set(UNITS[unit].config) <= known


# To name such a unit is for tables of what units have of their own, for what is one unit's (its file says so by its
# name), for faults, which lie in a file of somebody's, and for the benchmark and the page that are about it.
NAMES_UNITS = (
    "golden_model/contract/interfaces.py",
    "golden_model/models.py",
    "rtl/catalogue.py",
    "gen/package/package.py",
    "gen/formal/faults/",
    "lightloom/hardware/benches.py",
    "lightloom/commands/bench.py",
    "lightloom/pages/measure.py",
    "lightloom/pages/results.py",
)


def names_unit(unit: str, text: Sequence[ast.AST]) -> Iterable[str]:
    """Where a file asks whether something is that unit, or goes to its files: line and text of each place.

    These are strings that are its name, that of a class or module of its own, or a path through a folder of its name;
    and comparisons and `isinstance` with a class that is called so or comes from a file that is. Prose is not meant.
    """
    word = re.compile(rf"(?:\S*[/.])?{unit}(?:[/._]\S*)?|{unit.title()}\w*")
    own = {
        alias.asname or alias.name
        for node in text
        if isinstance(node, ast.ImportFrom) and unit in str(node.module)
        for alias in node.names
        if not alias.name.isupper()  # constants are what is compared, not what is asked
    }
    for node in text:
        asked: list[ast.expr] = []
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and word.fullmatch(node.value):
            yield f"{node.lineno}: {node.value!r}"
        elif isinstance(node, ast.Call) and ast.unparse(node.func) in ("isinstance", "issubclass"):
            asked = [one for one in ast.walk(node) if isinstance(one, ast.expr)]
        elif isinstance(node, ast.Compare):
            asked = [node.left, *node.comparators]
        elif isinstance(node, ast.MatchClass):
            asked = [node.cls]
        names = {ast.unparse(one).split(".")[-1] for one in asked if isinstance(one, ast.Name | ast.Attribute)}
        yield from (f"{asked[0].lineno}: {name}" for name in names if name in own or unit in name.lower())


@pytest.mark.parametrize(
    "text",
    [
        "unit == 'traversal'",
        "unit in ('float_add', 'traversal')",
        "f'{unit}' == f'traversal'",
        "isinstance(component, TraversalArray)",
        "isinstance(component, (Core, array.TraversalUnit))",
        "from lightloom.rtl.traversal.array import Units\ntype(component) is Units",
        "from lightloom.rtl.traversal.array import Units\nisinstance(component, Units)",
        "match component:\n    case TraversalArray(): pass",
        "type(component).__name__ == 'TraversalUnit'",
        "Path('rtl/traversal/unit.py')",
        "'rtl/traversal' in str(path)",
        "module.startswith('lightloom.rtl.traversal')",
        "module.startswith('traversal_')",
        "unit == benches.TRAVERSAL",
    ],
)
def test_a_unit_that_is_named_is_noticed(text: str) -> None:
    assert list(names_unit("traversal", list(ast.walk(ast.parse(text)))))


def test_prose_and_parameters_name_no_unit() -> None:
    text = (
        "'Rays of the traversal unit.'\nif depth < config.traversal.stack: run(config.traversal)\nbuild(TraversalUnit)"
    )
    assert list(names_unit("traversal", list(ast.walk(ast.parse(text))))) == []


def test_generic_code_names_no_unit_with_a_memory() -> None:
    wrong = [
        f"{path.relative_to(ROOT)}:{place}"
        for unit in UNITS
        if unit not in PURE
        for name, path in modules().items()
        if unit not in name and not str(path.relative_to(ROOT)).startswith(NAMES_UNITS)
        for place in names_unit(unit, nodes(path))
    ]
    assert not wrong, "\n".join(wrong)


def test_every_signal_has_a_line_of_its_own() -> None:
    # Amaranth names a signal by the line that makes it; of several in one line, only the last gets its name.
    wrong = [
        f"{path.relative_to(ROOT)}:{node.lineno}"
        for path in sources("rtl")
        for node in nodes(path)
        if isinstance(node, ast.Assign) and isinstance(node.value, ast.Tuple)
        if any(re.match(r"Signal\((?!.*name=)|.*_port\(", ast.unparse(value)) for value in node.value.elts)
    ]
    assert not wrong, "\n".join(wrong)


FILE_LINES = 600
"""Of a file at most."""
LINES = 60
"""Of a function at most, with its docstring; of a command without its options and its help, which are a page."""
LONG = {
    **dict.fromkeys(
        (
            "golden_model/tracing/bvh/traversal_numba.py:trace_rays",
            "golden_model/tracing/wide_bvh/traversal_numba.py:trace_rays",
        ),
        "compiled: one loop, whose state has to stay in registers",
    ),
    "gen/formal/writer.py:properties": "a table",
    "gen/flow/layout.py:place_and_route": "the commands of a tool, one after the other",
    "golden_model/renderer.py:__init__": "a field a line, and its options",
    "golden_model/tracing/bvh/build.py:build": "one loop over the levels of a tree",
    "sim/runner.py:run_cocotb": "options, most of which are handed on, and what they mean",
    "tests/gen/test_policies_page.py:made_up": "a report, as a table",
    "tests/rtl/registers/test_front.py:test_software_and_streams_share_a_unit": "two testbenches beside each other",
    "tests/rtl/registers/test_register_block.py:test_reads_and_writes_at_random": "two testbenches beside each other",
    "verif/benches/test_leaf_stage.py:run": "a cycle of a bench: port by port, over the same state",
}
"""Longer functions, each of which is best read whole, and why."""


@pytest.mark.parametrize("room", ROOMS)
def test_rooms_refuse_their_bare_names(room: str) -> None:
    """The checkout's folder is on the path here, as it is in an editable install."""
    with pytest.raises(ImportError, match=f"import lightloom.{room}"):
        import_module(room)


def test_functions_are_short() -> None:
    found: Counter[str] = Counter()
    for path in (*modules().values(), *sources("tests"), *sources("examples"), *ROOT.glob(".ci/*.py")):
        for node in nodes(path):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                is_command = path.parent == ROOT / "lightloom" / "commands" and not node.name.startswith("_")
                begin = node.body[ast.get_docstring(node) is not None].lineno if is_command else node.lineno
                if (node.end_lineno or begin) - begin >= LINES:
                    found[f"{path.relative_to(ROOT)}:{node.name}"] += 1
    long = set(found)
    assert sorted(long - LONG.keys()) == [], "split them, or say why not"
    assert sorted(LONG.keys() - long) == [], "these are short now"
    assert [name for name, times in found.items() if times > 1] == [], "one has a reason, the others do not"


def test_files_are_short() -> None:
    long = {
        str(path.relative_to(ROOT)): lines
        for path in (*modules().values(), *sources("tests"))
        if (lines := path.read_text(encoding="utf-8").count("\n")) > FILE_LINES
    }
    assert long == {}


# Results that depend on the host's processor or libraries have no place in the model's arithmetic.
HOST_DEPENDENT = re.compile(
    r"np\.(dot|matmul|einsum|inner|vdot|tensordot|a?sinh?|a?cosh?|a?tanh?|arc\w+|hypot|cbrt|exp2?|expm1|log\d*|log1p"
    r"|power|float_power)\(|np\.linalg\.|math\.(a?sinh?|a?cosh?|a?tanh?|atan2|exp2?|expm1|log\w*|pow|cbrt|hypot)\("
    r"|\.dot\(|fastmath=True| @ "
)


def test_model_arithmetic_does_not_depend_on_the_host() -> None:
    # Pictures for the eye are outside the contract: `golden_model/pictures` says so.
    wrong = [
        f"{path.relative_to(ROOT)}:{number}: {line.strip()}"
        for path in sources("golden_model")
        if path.name != "images.py"
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1)
        if HOST_DEPENDENT.search(line)
    ]
    assert not wrong, "\n".join(wrong)
