"""Symbolic steps that are built only if the cache does not have their machine code.

To build a step and to translate it takes longer than to process a short log. What a step is follows from the function
that builds it, its arguments, the source that both come from, and the versions of CasADi, NumPy and Python. The cache
keeps, by the digest of all these, the sizes of the step and the key of its machine code. The source of a step is the
module that builds it, with all modules of this package that this one imports: a change elsewhere does not compile the
step again.
"""

import functools
import json
import platform
import re
import threading
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, ParamSpec, TypeVar, cast

import casadi as ca
import numpy as np

import fifthwheel
from fifthwheel.base.lazy import lazy
from fifthwheel.base.native import cache

P = ParamSpec("P")
S = TypeVar("S")
PACKAGE = Path(fifthwheel.__file__).parent
_IMPORT = re.compile(r"^\s*from (fifthwheel[\w.]*) import (\([^)]*\)|.*)", re.MULTILINE)
_COMMENT = re.compile(r"#.*")
PLAIN = (str, bool, int, type(None))
"""Types of arguments that are their own identity."""


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


compiling = threading.RLock()
"""Held while a step is built, while LLVM is used, and while the process forks: a child never starts with a lock of LLVM
that a thread of its parent holds, and that nobody releases."""


class Step:
    """A step as the function that builds it and its arguments.

    An argument that is neither of `PLAIN` nor a tuple of such has an attribute `identity` that is; without it the step
    is built in every process.
    """

    def __init__(self, build: Callable[..., ca.Function], arguments: Sequence[Any] = ()) -> None:
        self._build, self._arguments = build, tuple(arguments)
        self._function: ca.Function | None = None

    @classmethod
    def of(cls, step: "ca.Function | Step") -> "Step":
        """A step, also of a function that is already built."""
        return step if isinstance(step, Step) else cls(lambda function: function, (step,))

    @property
    def function(self) -> ca.Function:
        """The CasADi function."""
        with compiling:
            if self._function is None:
                self._function = self._build(*self._arguments)
            return self._function

    @lazy
    def sizes(self) -> tuple[int, ...]:
        """Numbers of elements of all inputs, then of all outputs."""
        return tuple(self.recall("sizes", self._sizes))

    def _sizes(self) -> list[int]:
        step = self.function
        inputs, outputs = map(step.numel_in, range(step.n_in())), map(step.numel_out, range(step.n_out()))
        return [*inputs, *outputs]

    def recall(self, name: str, compute: Callable[[], list[Any]], *, again: bool = False) -> list[Any]:
        """A named list of numbers and texts that follows from the step, from the cache, or computed, or `again`."""
        if self._identity is None:
            return compute()
        key = cache.DIGEST(self._identity + name.encode()).digest()
        content = None if again else cache.read(key)
        if content is None:
            content = json.dumps(compute()).encode()
            cache.write(key, content)
        return cast(list[Any], json.loads(content))

    @lazy
    def _identity(self) -> bytes | None:
        """Digest of all that determines the step; None if that is not known."""
        arguments, modules = _plain(self._arguments), {self._build.__module__, *_modules(self._arguments)}
        if arguments is None or (source := source_digest(frozenset(modules))) is None:
            return None
        build = f"{self._build.__module__}.{self._build.__qualname__}"
        versions = ca.CasadiMeta.version(), np.__version__, platform.python_version()
        return cache.DIGEST(repr((build, arguments, versions)).encode() + source).digest()


def compiled(kind: Callable[[Step], S]) -> Callable[[Callable[P, ca.Function]], Callable[P, S]]:
    """Decorator: a function that builds a step becomes one that returns the compiled loop of the step.

    The function is called only if the cache does not have the machine code. It must be defined in a module of this
    package, depend on nothing but its arguments, and take positional arguments only.

    Args:
        kind: makes the loop, such as `Scan`.
    """

    def decorate(build: Callable[P, ca.Function]) -> Callable[P, S]:
        @functools.wraps(build)
        def make(*arguments: Any) -> S:
            return kind(Step(build, arguments))

        return cast(Callable[P, S], functools.cache(make))

    return decorate


def _plain(argument: Any) -> Any:
    """The identity of an argument; None for one that has none."""
    if isinstance(argument, tuple):
        parts = [_plain(part) for part in argument]
        return None if any(part is None for part in parts) else ("tuple", *parts)
    if isinstance(argument, PLAIN):
        return type(argument).__name__, argument
    identity = getattr(argument, "identity", None)
    plain = None if identity is None else _plain(identity)
    return None if plain is None else (type(argument).__qualname__, plain)


def _modules(argument: Any) -> Iterator[str]:
    """The modules that define an argument, or what is in it."""
    if isinstance(argument, tuple):
        for part in argument:
            yield from _modules(part)
    elif not isinstance(argument, PLAIN):
        yield type(argument).__module__
