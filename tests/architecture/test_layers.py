"""Imports run one way, computing packages stay light, files and functions stay small. Read from the source, not run."""

import ast
from collections.abc import Iterator, Mapping
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

from dsd_cli.cli.lazy import COMMANDS

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "dsd_cli"
FILES = sorted(PACKAGE.rglob("*.py"))

#: Layer -> what it may import of this project; `identify` is a sibling of nothing below it.
ALLOWED = {
    "errors": set(),
    "signals": {"errors"},
    "effects": {"signals", "errors"},
    "plant": {"effects", "signals", "errors"},
    "detect": {"plant", "effects", "signals", "errors"},
    "identify": {"plant", "effects", "signals", "errors"},
    "files": {"detect", "identify", "plant", "effects", "signals", "errors"},
    "export": {"identify", "plant", "effects", "signals", "errors"},
    "report": {"export", "detect", "identify", "plant", "effects", "signals", "errors"},
    "cli": {"report", "export", "files", "detect", "identify", "plant", "effects", "signals", "errors"},
    "__main__": {"cli"},
    "__init__": set(),
}
COMPUTING = {"errors", "signals", "effects", "plant", "detect", "identify"}
HEAVY = {"typer", "click", "rich", "pyarrow", "pydantic", "tomlkit", "matplotlib"}


def _layer(path: Path) -> str:
    return path.relative_to(PACKAGE).parts[0].removesuffix(".py")


def _imports(tree: ast.AST) -> Iterator[str]:
    """Every imported name, dotted, inside functions and under TYPE_CHECKING too."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "relative imports hide the layer"
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def _id(path: Path) -> str:
    return str(path.relative_to(ROOT))


@pytest.mark.parametrize("path", FILES, ids=_id)
def test_imports_run_one_way(path: Path) -> None:
    layer = _layer(path)
    assert layer in ALLOWED, f"new layer {layer}: say in ALLOWED what it may import"
    own = [name.split(".") for name in _imports(ast.parse(path.read_text("utf-8"))) if name.startswith("dsd_cli.")]
    upward = {".".join(parts) for parts in own if parts[1] in ALLOWED and parts[1] not in ALLOWED[layer] | {layer}}
    assert not upward


def _dotted(path: Path) -> str:
    return ".".join(path.relative_to(PACKAGE.parent).with_suffix("").parts).removesuffix(".__init__")


def _graph(sources: Mapping[str, str]) -> dict[str, set[str]]:
    """Module -> modules that its source imports, wherever it does: a late or a typing import hides a circle only."""
    graph = {}
    for module, source in sources.items():
        names = set(_imports(ast.parse(source)))
        graph[module] = {n if n in sources else n.rpartition(".")[0] for n in names} & sources.keys()
    return graph


def _circle(sources: Mapping[str, str]) -> list[str]:
    """Modules that import each other in a ring, the first one twice; empty if there is no such ring."""
    try:
        TopologicalSorter(_graph(sources)).prepare()
    except CycleError as error:
        return list(error.args[1])
    return []


def test_no_modules_import_each_other() -> None:
    assert _circle({_dotted(path): path.read_text("utf-8") for path in FILES}) == []


@pytest.mark.parametrize(
    "back",
    ["import pkg.a", "from pkg import a", "from pkg.a import x", "def f():\n    from pkg.a import x"],
    ids=["module", "from package", "name", "inside a function"],
)
def test_a_circle_is_found_however_it_is_imported(back: str) -> None:
    chain = {"pkg": "", "pkg.a": "from pkg.b import y", "pkg.b": "import pkg.c", "pkg.c": ""}
    assert _circle(chain) == []
    assert set(_circle({**chain, "pkg.c": back})) == {"pkg.a", "pkg.b", "pkg.c"}


#: Files that name an effect all the same, and why.
NAMING = {
    "detect/damping/derivative.py": "eq. 6 is about the viscous coefficient: candidates of it are the states",
    "export/targets/mjcf.py": "a stiffness is an attribute of a joint, too",
    "identify/search/play.py": "a stiffness is a parameter of play, too",
    "identify/search/response.py": "the response of two masses, without and with play, is that of these two alone",
}


@pytest.mark.parametrize("path", [p for p in FILES if _layer(p) != "effects"], ids=_id)
def test_effects_are_known_by_their_interface_alone(path: Path) -> None:
    """A search that asks for an effect by name finds ours and never that of a user."""
    others = {"__init__", "base", "catalogue", "general", "memory", "tables", "user"}
    own = {p.stem for p in (PACKAGE / "effects").glob("*.py")} - others
    texts = {n.value for n in ast.walk(ast.parse(path.read_text("utf-8"))) if isinstance(n, ast.Constant)}
    named = {text for text in texts if isinstance(text, str) and text.partition(".")[0] in own}
    assert bool(named) == (str(path.relative_to(PACKAGE)) in NAMING), named


@pytest.mark.parametrize("path", [p for p in FILES if _layer(p) in COMPUTING], ids=_id)
def test_computing_packages_know_no_files_and_no_terminals(path: Path) -> None:
    assert not {name.split(".")[0] for name in _imports(ast.parse(path.read_text("utf-8")))} & HEAVY


@pytest.mark.parametrize("path", sorted((ROOT / "tests/oracle").rglob("*.py")), ids=_id)
def test_the_oracle_imports_nothing_of_the_project(path: Path) -> None:
    assert not [name for name in _imports(ast.parse(path.read_text("utf-8"))) if name.split(".")[0] == "dsd_cli"]


@pytest.mark.parametrize("path", FILES, ids=_id)
def test_files_and_functions_stay_small(path: Path) -> None:
    source = path.read_text("utf-8")
    assert len(source.splitlines()) <= 300
    functions = (n for n in ast.walk(ast.parse(source)) if isinstance(n, ast.FunctionDef | ast.AsyncFunctionDef))
    long = {f.name: f.end_lineno - f.lineno + 1 for f in functions if f.end_lineno - f.lineno >= 60}
    assert not long


@pytest.mark.parametrize("path", FILES, ids=_id)
def test_no_global_that_functions_rebind(path: Path) -> None:
    assert not [n for n in ast.walk(ast.parse(path.read_text("utf-8"))) if isinstance(n, ast.Global)]


FRAME = [PACKAGE / "cli" / f"{name}.py" for name in ("main", "lazy", "coercion", "options")]
COMMAND_FILES = [PACKAGE / "cli" / f"{module}.py" for module, *_ in COMMANDS.values()]


@pytest.mark.parametrize("path", FRAME + COMMAND_FILES, ids=_id)
def test_commands_import_what_is_slow_only_when_they_run(path: Path) -> None:
    slow = HEAVY - {"typer", "click"} | {"numpy", "scipy"}
    top = [n for n in ast.parse(path.read_text("utf-8")).body if isinstance(n, ast.Import | ast.ImportFrom)]
    names = {name.split(".")[0] for node in top for name in _imports(node)}
    assert not names & slow
