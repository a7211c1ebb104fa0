"""Modules that can be called."""

import inspect
import sys
from collections.abc import Callable
from types import ModuleType
from typing import Any


def make_callable(module: str, function: Callable[..., Any]) -> None:
    """Make a module callable as its main function, so that both can have the same name in the package.

    Python sets `fifthwheel.estimate.identify` to the module when something imports it; the module is then called like the
    function of that name, and `help` shows the function first.
    """
    called, package = inspect.signature(function), sys.modules[module]
    plain = [p.replace(annotation=p.empty) for p in called.parameters.values()]
    call = f"{module.rpartition('.')[2]}{called.replace(parameters=plain, return_annotation=called.empty)}"
    summary, _, text = (inspect.getdoc(function) or "").partition("\n")
    package.__doc__ = f"{summary}\n\n{call}\n{text}\n\n{inspect.getdoc(package)}"
    attributes = {"__call__": staticmethod(function), "__signature__": called}
    package.__class__ = type("CallableModule", (ModuleType,), attributes)
