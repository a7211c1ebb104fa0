"""The architecture, read from the imports: rooms import only rooms before them, and there is no circle."""

import ast
import functools
import pkgutil
import subprocess
import sys
from collections.abc import Iterator
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pyarrow
import pytest

import fifthwheel

SOURCE = Path(fifthwheel.__file__).parent

ROOMS = (
    "_callable",
    "_lazy",
    "_memory",
    "_types",
    "_addresses",
    "errors",
    "_arguments",
    "settings",
    "options",
    "_extras",
    "units",
    "formatting",
    "names",
    "channels",
    "_atomic",
    "input_files",
    "checked_json",
    "plots",
    "native",
    "pages",
    "record",
    "checks",
    "logs",
    "vehicle",
    "spoken_names",
    "dynamics",
    "manoeuvres",
    "plot",
    "filters",
    "simulate",
    "plant",
    "time_bases",
    "stream",
    "observe",
    "identify",
    "cluster",
    "studies",
    "cheng_cebon_2011",
    "export",
    "assess",
    "evaluate",
    "diagnose",
    "report",
    "workflow",
    "selfcheck",
    "live",
    "app",
    "fleet",
    "cli",
)
"""The data flow: a room imports only rooms that stand before it."""


@functools.cache
def modules() -> dict[str, ast.Module]:
    """Syntax tree of every module by its dotted name within the package."""
    return {
        ".".join(path.relative_to(SOURCE).with_suffix("").parts).removesuffix(".__init__"): ast.parse(path.read_text())
        for path in SOURCE.rglob("*.py")
    }


def imported(tree: ast.Module, names: set[str], *, deferred: bool) -> Iterator[str]:
    """Modules of the package that a module imports; with `deferred` also those imported in functions."""
    for node in ast.walk(tree) if deferred else top_level(tree):
        if isinstance(node, ast.ImportFrom) and node.module and node.module.split(".")[0] == "fifthwheel":
            base = node.module.removeprefix("fifthwheel").removeprefix(".")
            for alias in node.names:
                full = f"{base}.{alias.name}" if base else alias.name
                yield full if full in names else base


def top_level(tree: ast.Module) -> Iterator[ast.stmt]:
    """Statements that run when the module is imported; a block for type checkers does not run."""
    for node in tree.body:
        if isinstance(node, ast.If):
            if "TYPE_CHECKING" not in ast.unparse(node.test):
                yield from node.body
        else:
            yield node


def test_a_room_imports_only_rooms_before_it() -> None:
    trees = modules()
    wrong = []
    for name, tree in trees.items():
        room = name.partition(".")[0]
        if room in ("__init__", "__main__"):
            continue
        for other in imported(tree, set(trees), deferred=True):
            if other and ROOMS.index(other.partition(".")[0]) > ROOMS.index(room):
                wrong.append(f"{name} imports {other}")
    assert not wrong, "\n".join(wrong)


def test_no_circle_between_modules() -> None:
    trees = modules()
    graph = {
        name: {
            other
            for other in imported(tree, set(trees), deferred=True)
            if other and other != name and not name.startswith(other + ".")
        }
        for name, tree in trees.items()
    }
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        pytest.fail(" -> ".join(error.args[1]))


def test_every_room_is_listed() -> None:
    present = {path.stem for path in SOURCE.iterdir() if path.suffix == ".py" or (path / "__init__.py").exists()}
    assert present - {"__init__", "__main__"} <= set(ROOMS)


def test_submodules_of_pyarrow_are_imported_where_they_are_used() -> None:
    """`pa.compute` exists only after an import of `pyarrow.compute`, which another library may or may not have done."""
    alone = subprocess.run(
        [sys.executable, "-c", "import pyarrow; print(*dir(pyarrow))"], capture_output=True, text=True, check=True
    )
    submodules = {module.name for module in pkgutil.iter_modules(pyarrow.__path__)} - set(alone.stdout.split())
    assert "compute" in submodules
    for path in SOURCE.rglob("*.py"):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        used = {
            node.attr
            for node in ast.walk(tree)
            if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id == "pa"
            if node.attr in submodules
        }
        assert not used, f"{path.relative_to(SOURCE)}: import pyarrow.{', pyarrow.'.join(sorted(used))}"
