"""Packages that only some functions need; the error names the extra that installs them."""

from importlib import import_module
from typing import Any

from fifthwheel.errors import FifthwheelError


def require(package: str, extra: str) -> Any:
    """The imported package, or a FifthwheelError that names the extra of fifthwheel that installs it."""
    try:
        return import_module(package)
    except ImportError:
        raise FifthwheelError(
            f"{package} is needed but not installed; pip install 'fifthwheel[{extra}]', or pip install {package}"
        ) from None
