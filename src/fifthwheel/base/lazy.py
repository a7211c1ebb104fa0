"""Attributes that are computed, names that are imported, and packages that are required, when they are first used."""

import functools
import re
import sys
from collections.abc import Callable
from contextlib import nullcontext
from importlib import import_module
from typing import Any, TypeVar

T = TypeVar("T")
_PROJECTS = {"can": "python-can", "mcap_ros2": "mcap-ros2-support", "PIL": "pillow"}
"""What pip installs for a package with another name."""


class lazy(functools.cached_property[T]):  # noqa: N801 (a decorator)
    """`functools.cached_property` without its lock, which only Python 3.11 has.

    A process that forks while a thread computes the attribute would otherwise inherit a lock that nobody releases. Two
    threads may compute the attribute at the same time; its function must not have other effects.
    """

    def __init__(self, function: Callable[[Any], T]) -> None:
        super().__init__(function)
        self.lock = nullcontext()


def lazy_names(
    package: str, **renamed: tuple[str, str]
) -> tuple[Callable[[str], Any], Callable[[], list[str]], list[str]]:
    """`__getattr__`, `__dir__` and `__all__` of a package whose names are imported when they are first used.

    The package states each name once, as type checkers need it: `from module import name as name` below
    `TYPE_CHECKING`; the name may be that of a module.

    Args:
        package: its `__name__`.
        renamed: module and name there, by the name in the package, where they differ.
    """
    this = sys.modules[package]
    source = this.__loader__.get_source(package)  # type: ignore[union-attr]  # also in an archive
    places = {name: (module, name) for module, name in re.findall(r"from ([\w.]+) import (\w+) as \2\b", source)}
    places |= renamed

    def imported(name: str) -> Any:
        if name not in places:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        module, original = places[name]
        home = import_module(module)
        value = getattr(home, original) if hasattr(home, original) else import_module(f"{module}.{original}")
        setattr(this, name, value)
        return value

    names = sorted(places)
    return imported, lambda: names, names


def require(package: str, extra: str) -> Any:
    """The imported package, or a FifthwheelError that names the extra of fifthwheel that installs it."""
    try:
        module = import_module(package)
    except ImportError:
        module = None
    spec = getattr(module, "__spec__", None)
    if module and (spec is None or spec.origin):  # what pip left behind has no origin
        return module
    from fifthwheel.base.errors import FifthwheelError  # most programs need no error

    top = package.partition(".")[0]
    project = _PROJECTS.get(top, top)
    raise FifthwheelError(
        f"{project} is needed but not installed; pip install 'fifthwheel[{extra}]', or pip install {project}"
    )
