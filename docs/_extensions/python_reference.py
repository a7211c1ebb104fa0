"""The reference of the public Python names, from `fifthwheel.__all__`."""

import inspect
import re
from collections.abc import Iterator
from typing import Any, get_type_hints

from sphinx.application import Sphinx
from sphinx.util.typing import stringify_annotation

import fifthwheel
from fifthwheel.settings import Settings, options_of

SECTION = re.compile(r"(Args|Returns|Yields|Raises|Example|Examples|Attributes|Note|Notes):$")


def reference() -> Iterator[str]:
    """A directive of autodoc for each public name: functions first, then data, then errors."""
    kinds: dict[str, list[str]] = {"Functions": [], "Classes": [], "Errors": [], "Modules": []}
    for name in fifthwheel.__all__:
        if name == "__version__":
            continue
        value = getattr(fifthwheel, name)
        if inspect.isclass(value):
            kinds["Errors" if issubclass(value, Exception) else "Classes"].append(name)
        else:
            kinds["Functions" if callable(value) else "Modules"].append(name)
    for title, names in kinds.items():
        if names:
            yield f"## {title}\n"
        for name in names:
            yield f"### {name}\n\n```{{eval-rst}}\n{directive(name)}\n```\n"


def directive(name: str) -> str:
    value = getattr(fifthwheel, name)
    if inspect.isclass(value):
        return f".. autoclass:: fifthwheel.{name}\n   :members:\n   :member-order: bysource"
    if inspect.ismodule(value) and callable(value):  # a module that is called like its function
        function = value.__call__
        return f".. autofunction:: {function.__module__}.{function.__name__}"
    if inspect.ismodule(value):
        return f".. automodule:: fifthwheel.{name}\n   :members:"
    return f".. autofunction:: fifthwheel.{name}"


def add_reference(app: Sphinx, document: str, source: list[str]) -> None:
    if document == "api":
        source[0] += "\n" + "\n".join(reference())


def quote_blocks(app: Sphinx, what: str, name: str, obj: Any, options: Any, lines: list[str]) -> None:
    """Show an indented block of a docstring, such as a table, as it is; sections such as `Args:` are left alone."""
    quoted: list[str] = []
    for i, line in enumerate(lines):
        if SECTION.match(line):
            quoted += lines[i:]
            break
        begins = line.startswith("  ") and i > 1 and not lines[i - 1].strip() and not lines[i - 2].startswith(" ")
        quoted += ["::", "", line] if begins and not lines[i - 2].endswith("::") else [line]
    lines[:] = quoted


def plain_types(
    app: Sphinx, what: str, name: str, obj: Any, options: Any, signature: str | None, result: str | None
) -> None:
    """Show the types of settings without their limits."""
    if isinstance(obj, type) and issubclass(obj, Settings):
        shown, hints = app.env.temp_data["annotations"][name], get_type_hints(obj)
        shown |= {key: stringify_annotation(hints[key], "smart") for key in shown if key in hints}


def describe_options(app: Sphinx, what: str, name: str, obj: Any, options: Any, lines: list[str]) -> None:
    """Describe the settings that are options by their help."""
    if isinstance(obj, type) and issubclass(obj, Settings) and options_of(obj):
        lines += ["", "Args:", *(f"    {key}: {option.help}" for key, option in options_of(obj).items())]


def setup(app: Sphinx) -> dict[str, Any]:
    app.connect("source-read", add_reference)
    app.connect("autodoc-process-docstring", quote_blocks, priority=400)  # before napoleon
    app.connect("autodoc-process-docstring", describe_options, priority=401)
    app.connect("autodoc-process-signature", plain_types, priority=900)  # after the types are recorded
    return {"parallel_read_safe": True}
