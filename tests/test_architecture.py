"""The imports of the package: import-linter keeps the layers; there is no circle between modules."""

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


@functools.cache
def modules() -> dict[str, ast.Module]:
    """Syntax tree of every module by its dotted name within the package."""
    return {
        ".".join(path.relative_to(SOURCE).with_suffix("").parts).removesuffix(".__init__"): ast.parse(path.read_text())
        for path in SOURCE.rglob("*.py")
    }


def imported(tree: ast.Module, names: set[str], *, deferred: bool) -> Iterator[str]:
    """Modules of the package that a module imports; with `deferred` also those imported in functions."""
    for node in statements(tree) if deferred else top_level(tree):
        if isinstance(node, ast.ImportFrom) and node.module and node.module.split(".")[0] == "fifthwheel":
            base = node.module.removeprefix("fifthwheel").removeprefix(".")
            for alias in node.names:
                full = f"{base}.{alias.name}" if base else alias.name
                yield full if full in names else base


def statements(tree: ast.AST) -> Iterator[ast.AST]:
    """All statements at any depth, without their expressions, which contain no import."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.stmt | ast.excepthandler | ast.match_case):
            yield node
            yield from statements(node)


def top_level(tree: ast.Module) -> Iterator[ast.stmt]:
    """Statements that run when the module is imported; a block for type checkers does not run."""
    for node in tree.body:
        if isinstance(node, ast.If):
            if "TYPE_CHECKING" not in ast.unparse(node.test):
                yield from node.body
        else:
            yield node


@pytest.mark.slow
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


@pytest.mark.slow
def test_submodules_of_pyarrow_are_imported_where_they_are_used() -> None:
    """`pa.compute` exists only after an import of `pyarrow.compute`, which another library may or may not have done."""
    alone = subprocess.run(
        [sys.executable, "-c", "import pyarrow; print(*dir(pyarrow))"], capture_output=True, text=True, check=True
    )
    submodules = {module.name for module in pkgutil.iter_modules(pyarrow.__path__)} - set(alone.stdout.split())
    assert "compute" in submodules
    for name, tree in modules().items():
        used = {
            node.attr
            for node in ast.walk(tree)
            if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id == "pa"
            if node.attr in submodules
        }
        assert not used, f"{name}: import pyarrow.{', pyarrow.'.join(sorted(used))}"
