"""Public names that have moved: they still work in their former package, with a warning."""

import warnings
from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any


def moved(package: str, places: Mapping[str, str]) -> Callable[[str], Any]:
    """The `__getattr__` of a package from which names have moved.

    Args:
        package: its `__name__`.
        places: "module.name" of today by former name.
    """

    def find(name: str) -> Any:
        if name not in places:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        module, _, attribute = places[name].rpartition(".")
        message = f"{package}.{name} has moved; import {attribute} from {module}"
        warnings.warn(message, DeprecationWarning, stacklevel=2)
        return getattr(import_module(module), attribute)

    return find
