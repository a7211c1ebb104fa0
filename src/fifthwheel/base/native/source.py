"""The source of this package that determines a step: the module that builds it, and all modules that this one imports.

A change elsewhere does not compile the step again.
"""

import functools
import re
from collections.abc import Iterator
from pathlib import Path

import fifthwheel
from fifthwheel.base.native import cache

PACKAGE = Path(fifthwheel.__file__).parent
_IMPORT = re.compile(r"^\s*from (fifthwheel[\w.]*) import (\([^)]*\)|.*)", re.MULTILINE)
_COMMENT = re.compile(r"#.*")


@functools.cache
def source_digest(modules: frozenset[str]) -> bytes | None:
    """Digest of the source of some modules of this package and of all that they import.

    None if a module is not of this package, or if it may not be the source that this process has imported.
    """
    if not all(_file(module) for module in modules):
        return None
    result, newest = cache.DIGEST(), 0.0
    for path in sorted(closure(modules)):
        status, content = path.stat(), _content(path)
        newest = max(newest, status.st_mtime, status.st_ctime)
        result.update(f"{path.relative_to(PACKAGE)} {len(content)}\n".encode() + content)
    return result.digest() if newest < fifthwheel.imported_at else None


def closure(modules: frozenset[str]) -> set[Path]:
    """The files of modules of this package and of all modules of it that they import, directly or not."""
    found: set[Path] = set()
    waiting = {file for module in modules if (file := _file(module))}
    while waiting:
        path = waiting.pop()
        found.add(path)
        waiting |= _imported(path) - found
    return found


@functools.cache
def _imported(path: Path) -> frozenset[Path]:
    """The files of the modules that a file imports, also those imported in a function."""
    return frozenset(file for module in _imported_names(_content(path).decode()) if (file := _file(module)))


def _imported_names(text: str) -> Iterator[str]:
    for match in _IMPORT.finditer(text):
        module, names = match[1], _COMMENT.sub("", match[2])
        for name in names.strip("()").split(","):
            whole = f"{module}.{name.split(' as ')[0].strip()}"
            yield whole if _file(whole) else module


@functools.cache
def _file(module: str) -> Path | None:
    """The file of a module of this package by its dotted name; None if there is none."""
    first, *parts = module.split(".")
    if first != PACKAGE.name or not parts:
        return None
    stem = PACKAGE.joinpath(*parts)
    return next((path for path in (stem.with_suffix(".py"), stem / "__init__.py") if path.is_file()), None)


@functools.cache
def _content(path: Path) -> bytes:
    return path.read_bytes()
