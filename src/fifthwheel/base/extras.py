"""Packages that only some functions need; the error names the extra that installs them."""

from importlib import import_module
from typing import Any

from fifthwheel.base.errors import FifthwheelError

_PROJECTS = {"can": "python-can", "PIL": "pillow"}
"""What pip installs for a package with another name."""


def require(package: str, extra: str) -> Any:
    """The imported package, or a FifthwheelError that names the extra of fifthwheel that installs it."""
    try:
        module = import_module(package)
    except ImportError:
        module = None
    spec = getattr(module, "__spec__", None)
    if module and (spec is None or spec.origin):  # what pip left behind has no origin
        return module
    top = package.partition(".")[0]
    project = _PROJECTS.get(top, top)
    raise FifthwheelError(
        f"{project} is needed but not installed; pip install 'fifthwheel[{extra}]', or pip install {project}"
    )
