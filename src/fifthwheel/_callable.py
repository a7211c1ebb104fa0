"""Modules that can be called."""

import inspect
import sys
from collections.abc import Callable
from types import ModuleType
from typing import Any


def make_callable(module: str, function: Callable[..., Any]) -> None:
    """Make a module callable as its main function, so that both can have the same name in the package.

    Python sets `fifthwheel.identify` to the module when something imports it; the module is then called like the
    function of that name.
    """
    attributes = {"__call__": staticmethod(function), "__signature__": inspect.signature(function)}
    sys.modules[module].__class__ = type("CallableModule", (ModuleType,), attributes)
