"""Imports run one way, computing packages stay light, files and functions stay small. Read from the source, not run."""

import ast
from collections.abc import Iterable, Iterator, Mapping
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

from dsd_cli.cli.lazy import COMMANDS

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "dsd_cli"
Nodes = dict[Path, list[ast.AST]]

#: Layer -> what it may import of this project; `identify` is a sibling of nothing below it.
ALLOWED = {
    "errors": set(),
    "signals": {"errors"},
    "effects": {"signals", "errors"},
    "plant": {"effects", "signals", "errors"},
    "detect": {"plant", "effects", "signals", "errors"},
    "identify": {"plant", "effects", "signals", "errors"},
    "design": {"identify", "plant", "effects", "signals", "errors"},
    "learn": {"identify", "plant", "effects", "signals", "errors"},
    "roles": {"identify", "plant", "effects", "signals", "errors"},
    "passport": {"identify", "plant", "effects", "signals", "errors"},
    "files": {"detect", "design", "passport", "identify", "plant", "effects", "signals", "errors"},
    "export": {"identify", "plant", "effects", "signals", "errors"},
    "report": {
        *("export", "detect", "design", "learn", "passport", "identify", "plant", "effects", "signals", "errors"),
    },
    "cli": {
        *("report", "export", "files", "detect", "design", "learn", "roles", "passport", "identify"),
        *("plant", "effects", "signals", "errors"),
    },
    "__main__": {"cli"},
    "__init__": set(),
}
COMPUTING = {"errors", "signals", "effects", "plant", "detect", "identify", "design", "learn", "roles", "passport"}
HEAVY = {"typer", "click", "rich", "pyarrow", "pydantic", "tomlkit", "matplotlib"}


@pytest.fixture(scope="module")
def package() -> Nodes:
    """Every file of the package with the nodes of its tree, read once."""
    return {path: list(ast.walk(ast.parse(path.read_text("utf-8")))) for path in sorted(PACKAGE.rglob("*.py"))}


def _layer(path: Path) -> str:
    return path.relative_to(PACKAGE).parts[0].removesuffix(".py")


def _imports(nodes: Iterable[ast.AST]) -> Iterator[str]:
    """Every imported name, dotted, inside functions and under TYPE_CHECKING too."""
    for node in nodes:
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "relative imports hide the layer"
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def _id(path: Path) -> str:
    return str(path.relative_to(ROOT))


def _upward(path: Path, nodes: Iterable[ast.AST]) -> set[str]:
    """What a file imports of a layer that it must not know."""
    layer = _layer(path)
    assert layer in ALLOWED, f"new layer {layer}: say in ALLOWED what it may import"
    own = [name.split(".") for name in _imports(nodes) if name.startswith("dsd_cli.")]
    return {".".join(parts) for parts in own if parts[1] in ALLOWED and parts[1] not in ALLOWED[layer] | {layer}}


def test_imports_run_one_way(package: Nodes) -> None:
    assert {_id(path): found for path, nodes in package.items() if (found := _upward(path, nodes))} == {}


def _dotted(path: Path) -> str:
    return ".".join(path.relative_to(PACKAGE.parent).with_suffix("").parts).removesuffix(".__init__")


def _graph(modules: Mapping[str, Iterable[ast.AST]]) -> dict[str, set[str]]:
    """Module -> modules that its nodes import, wherever they do: a late or a typing import hides a circle only."""
    graph = {}
    for module, nodes in modules.items():
        names = set(_imports(nodes))
        graph[module] = {n if n in modules else n.rpartition(".")[0] for n in names} & modules.keys()
    return graph


def _circle(modules: Mapping[str, Iterable[ast.AST]]) -> list[str]:
    """Modules that import each other in a ring, the first one twice; empty if there is no such ring."""
    try:
        TopologicalSorter(_graph(modules)).prepare()
    except CycleError as error:
        return list(error.args[1])
    return []


def test_no_modules_import_each_other(package: Nodes) -> None:
    assert _circle({_dotted(path): nodes for path, nodes in package.items()}) == []


@pytest.mark.parametrize(
    "back",
    ["import pkg.a", "from pkg import a", "from pkg.a import x", "def f():\n    from pkg.a import x"],
    ids=["module", "from package", "name", "inside a function"],
)
def test_a_circle_is_found_however_it_is_imported(back: str) -> None:
    chain = {"pkg": "", "pkg.a": "from pkg.b import y", "pkg.b": "import pkg.c", "pkg.c": ""}
    straight, ring = (
        {m: list(ast.walk(ast.parse(s))) for m, s in one.items()} for one in (chain, chain | {"pkg.c": back})
    )
    assert _circle(straight) == []
    assert set(_circle(ring)) == {"pkg.a", "pkg.b", "pkg.c"}


#: Files that name an effect all the same, and why.
NAMING = {
    "detect/damping/derivative.py": "eq. 6 is about the viscous coefficient: candidates of it are the states",
    "export/targets/mjcf.py": "a stiffness is an attribute of a joint, too",
    "identify/search/play.py": "a stiffness is a parameter of play, too",
    "identify/search/response.py": "a stiffness is a parameter of play, too",
    "identify/search/seen.py": "the response of two masses, without and with play, is that of these two alone",
}


def test_effects_are_known_by_their_interface_alone(package: Nodes) -> None:
    """A search that asks for an effect by name finds ours and never that of a user."""
    others = {"__init__", "base", "catalogue", "general", "memory", "tables", "user"}
    own = {p.stem for p in (PACKAGE / "effects").glob("*.py")} - others
    named = {}
    for path, nodes in package.items():
        texts = {n.value for n in nodes if isinstance(n, ast.Constant) and isinstance(n.value, str)}
        if _layer(path) != "effects" and (found := {text for text in texts if text.partition(".")[0] in own}):
            named[str(path.relative_to(PACKAGE))] = found
    assert named.keys() == NAMING.keys(), named


def test_computing_packages_know_no_files_and_no_terminals(package: Nodes) -> None:
    computing = {path: nodes for path, nodes in package.items() if _layer(path) in COMPUTING}
    heavy = {_id(path): {name.split(".")[0] for name in _imports(nodes)} & HEAVY for path, nodes in computing.items()}
    assert {path: names for path, names in heavy.items() if names} == {}


@pytest.mark.parametrize("path", sorted((ROOT / "tests/oracle").rglob("*.py")), ids=_id)
def test_the_oracle_imports_nothing_of_the_project(path: Path) -> None:
    assert not [
        name for name in _imports(ast.walk(ast.parse(path.read_text("utf-8")))) if name.split(".")[0] == "dsd_cli"
    ]


def test_files_and_functions_stay_small(package: Nodes) -> None:
    lines = {_id(path): len(path.read_text("utf-8").splitlines()) for path in package}
    assert {path: count for path, count in lines.items() if count > 300} == {}
    long = {}
    for path, nodes in package.items():
        functions = (n for n in nodes if isinstance(n, ast.FunctionDef | ast.AsyncFunctionDef))
        found = ((f"{_id(path)}: {f.name}", f.end_lineno - f.lineno + 1) for f in functions)
        long.update((name, count) for name, count in found if count > 60)
    assert long == {}


def test_no_global_that_functions_rebind(package: Nodes) -> None:
    assert [_id(path) for path, nodes in package.items() if any(isinstance(n, ast.Global) for n in nodes)] == []


FRAME = [PACKAGE / "cli" / f"{name}.py" for name in ("main", "lazy", "coercion", "options")]
COMMAND_FILES = [PACKAGE / "cli" / f"{module}.py" for module, *_ in COMMANDS.values()]


@pytest.mark.parametrize("path", FRAME + COMMAND_FILES, ids=_id)
def test_commands_import_what_is_slow_only_when_they_run(path: Path) -> None:
    slow = HEAVY - {"typer", "click"} | {"numpy", "scipy"}
    top = [n for n in ast.parse(path.read_text("utf-8")).body if isinstance(n, ast.Import | ast.ImportFrom)]
    names = {name.split(".")[0] for name in _imports(top)}
    assert not names & slow
