"""The reference of the public Python names: a page for each idea, and the list of all names on the page `api`."""

import inspect
import re
from collections.abc import Iterator
from dataclasses import is_dataclass
from enum import Enum
from functools import cache, reduce
from importlib import import_module
from operator import or_
from pathlib import Path
from types import UnionType
from typing import Annotated, Any, NamedTuple, Union, get_args, get_origin, get_type_hints

from pydantic import BaseModel
from sphinx.application import Sphinx
from sphinx.pycode import ModuleAnalyzer
from sphinx.util.typing import stringify_annotation

import fifthwheel
from fifthwheel.base.settings import Settings

SECTION = re.compile(r"(Args|Returns|Yields|Raises|Example|Examples|Attributes|Note|Notes):$")
IDEAS = {
    "Records and logs": ("data.record", "data.logs", "data.checks", "estimate.time_bases"),
    "Vehicles": ("truck",),
    "Linear model": ("model.dynamics", "model.dynamics.summary", "results.plot"),
    "Simulation": ("model.simulate", "model.manoeuvres", "model.plant"),
    "Identification": (
        "estimate.identify",
        "estimate.identify.mass",
        "results.diagnose.comparison",
        "apps.cheng_cebon_2011",
    ),
    "Knowledge": (
        "estimate.identify.knowledge.knowledge",
        "estimate.identify.knowledge.information",
        "estimate.identify.knowledge.load",
    ),
    "Live estimation": ("estimate.online",),
    "Design of test runs": ("estimate.design",),
    "States": ("estimate.observe",),
    "Performance measures": ("results.assess",),
    "Test methods": ("results.evaluate",),
    "Reports and plots": ("results.report", "base.plots", "base.pages.terminal"),
    "Export": ("results.export",),
    "Fleets": ("apps.fleet",),
    "Studies": ("apps.studies",),
    "Errors": ("base.errors",),
}
"""Modules below `fifthwheel` by the title of their page. A module without `__all__` has the names of `fifthwheel`."""
INTERNAL = re.compile(
    r"fifthwheel\.(base\.(native|pages)|model\.plant\.truck|estimate\.(filters(?!\.relinearised)"
    r"|identify\.(one_stage|dataset|unknowns|noise_model|online\.live_filter|knowledge\.(states|combination))"
    r"|observe\.(observed_chain|uncertainty)))\b"
)
"""Modules whose types no user needs; `RelinearisationSettings` is one of the settings."""


class Entry(NamedTuple):
    """A public name, or a type that one returns."""

    path: str
    value: Any

    @property
    def name(self) -> str:
        """As users write it after `fifthwheel.`."""
        return self.path.removeprefix("fifthwheel.")

    def summary(self) -> str:
        """First sentence of its documentation."""
        if inspect.isroutine(self.value) or inspect.isclass(self.value) or inspect.ismodule(self.value):
            text = inspect.getdoc(self.value) or ""
        else:
            module, _, name = self.path.rpartition(".")
            text = " ".join(attribute_docs(module).get(name, ()))
        return " ".join(re.split(r"\n\s*\n|(?<=\.)\s", text.strip(), maxsplit=1)[0].split())

    def directive(self) -> str:
        if inspect.isclass(self.value):
            hidden = "model_config, plausible, si_units" if issubclass(self.value, BaseModel) else ""
            return (
                f".. autoclass:: {self.path}\n   :members:\n   :member-order: bysource\n   :exclude-members: {hidden}"
            )
        if inspect.isroutine(self.value):
            return f".. autofunction:: {self.path}"
        if inspect.ismodule(self.value):
            return f".. automodule:: {self.path}\n   :no-index:"
        module, _, name = self.path.rpartition(".")  # autodata shows the docstring of the type of a constant
        return "\n   ".join([f".. py:data:: {self.path}", "", *attribute_docs(module)[name]])


@cache
def attribute_docs(module: str) -> dict[str, list[str]]:
    """Documentation of the constants of a module, also of those that a package imports from its modules."""
    found: dict[str, list[str]] = {}
    for name in re.findall(
        r"^ *from (fifthwheel[\w.]*) import", inspect.getsource(import_module(module)), re.MULTILINE
    ):
        if name.startswith(f"{module}."):
            found |= attribute_docs(name)
    analyzer = ModuleAnalyzer.for_module(module)
    analyzer.analyze()
    return found | {key: text for (owner, key), text in analyzer.attr_docs.items() if not owner}


def public(module: str) -> Iterator[Entry]:
    """The public names of a module, as `fifthwheel.NAME` where they are public there."""
    package = import_module(f"fifthwheel.{module}")
    stated = re.findall(rf"from fifthwheel\.{module} import (\w+) as", inspect.getsource(fifthwheel))
    names = [*getattr(package, "__all__", ()), *stated]
    names = names or [name for name, value in vars(package).items() if is_of(value, package.__name__)]
    for name in sorted(dict.fromkeys(names), key=str.casefold):
        value = getattr(package, name)
        yield Entry(f"fifthwheel.{short(value) or f'{short(package) or module}.{name}'}", value)


def short(value: Any) -> str | None:
    """The name that `fifthwheel` has for it."""
    return next((name for name in fifthwheel.__all__ if getattr(fifthwheel, name) is value), None)


def is_of(value: Any, module: str) -> bool:
    """Whether a module defines this function for users."""
    return inspect.isfunction(value) and value.__module__ == module and not value.__name__.startswith("_")


def returned(value: Any) -> Iterator[type]:
    """Classes of the package that a function returns, or the methods, properties and fields of a class."""
    if inspect.isclass(value) and not issubclass(value, (Enum, Exception)):
        if is_dataclass(value) or issubclass(value, BaseModel):
            yield from classes(tuple(hints(value).values()))
        for name, member in vars(value).items():
            if not name.startswith("_"):
                function = getattr(member, "fget", None) or getattr(member, "func", None) or member
                yield from returned(getattr(function, "__func__", function))
    elif inspect.isfunction(value):
        yield from classes(hints(value).get("return"))


def hints(value: Any) -> dict[str, Any]:
    try:
        return get_type_hints(value)
    except (NameError, AttributeError):  # a type that is imported for type checkers only
        return {}


def classes(hint: Any) -> Iterator[type]:
    """The public classes of the package in a type."""
    if inspect.isclass(hint) and not get_args(hint):
        known = hint.__module__.startswith("fifthwheel.") and not hint.__name__.startswith("_")
        if known and not INTERNAL.match(hint.__module__):
            yield hint
    for part in hint if isinstance(hint, tuple) else get_args(hint):
        yield from classes(part)


def pages() -> dict[str, list[Entry]]:
    """The entries of each page by its title; types that a name returns are on the page of the first that does."""
    found = {title: [entry for module in modules for entry in public(module)] for title, modules in IDEAS.items()}
    known = {id(entry.value) for entries in found.values() for entry in entries}
    for entries in found.values():
        for entry in entries:  # grows
            for kind in returned(entry.value):
                if id(kind) not in known:
                    known.add(id(kind))
                    entries.append(Entry(f"{kind.__module__}.{kind.__qualname__}", kind))
    return found


def file_of(title: str) -> str:
    return title.lower().replace(" ", "-")


def write_pages(app: Sphinx) -> None:
    """Write the pages below `api/`; a file that has not changed keeps its time."""
    folder = Path(app.srcdir) / "api"
    folder.mkdir(exist_ok=True)
    for title, entries in pages().items():
        blocks = [f"## {entry.name}\n\n```{{eval-rst}}\n{entry.directive()}\n```\n" for entry in entries]
        text = "\n".join([f"# {title}\n", *blocks])
        file = folder / f"{file_of(title)}.md"
        if not file.exists() or file.read_text(encoding="utf-8") != text:
            file.write_text(text, encoding="utf-8")


def lists() -> Iterator[str]:
    """Markdown of the list of names of all pages."""
    listed = "\n".join(f"api/{file_of(title)}" for title in IDEAS)
    yield f"```{{toctree}}\n:hidden:\n\n{listed}\n```\n"
    for title, entries in pages().items():
        yield f"## {title}\n"
        for entry in entries:
            link = f"api/{file_of(title)}.md#{entry.name.lower().replace('.', '')}"
            yield f"- [`{entry.name}`]({link}): {entry.summary()}"
        yield ""


def add_lists(app: Sphinx, document: str, source: list[str]) -> None:
    if document == "api":
        source[0] += "\n" + "\n".join(lists())


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


def keep_sentences(app: Sphinx, what: str, name: str, obj: Any, options: Any, lines: list[str]) -> None:
    """Keep the documentation of an attribute from napoleon, which reads the words before a colon as its type."""
    if what in ("attribute", "data", "property"):
        app.env.temp_data["sentences"] = list(lines)


def restore_sentences(app: Sphinx, what: str, name: str, obj: Any, options: Any, lines: list[str]) -> None:
    if what in ("attribute", "data", "property"):
        lines[:] = app.env.temp_data.pop("sentences")


def plain_types(
    app: Sphinx, what: str, name: str, obj: Any, options: Any, signature: str | None, result: str | None
) -> None:
    """Show the types of settings and vehicles without their limits."""
    if isinstance(obj, type) and issubclass(obj, (Settings, BaseModel)):
        shown, types = app.env.temp_data["annotations"][name], hints(obj)
        shown |= {key: stringify_annotation(without_limits(types[key]), "smart") for key in shown if key in types}


def without_limits(hint: Any) -> Any:
    """A type without metadata, also within a union."""
    if get_origin(hint) is Annotated:
        return without_limits(hint.__origin__)
    if get_origin(hint) in (Union, UnionType):
        return reduce(or_, map(without_limits, get_args(hint)))
    return hint


def describe_fields(app: Sphinx, what: str, name: str, obj: Any, options: Any, lines: list[str]) -> None:
    """Describe the numbers of a vehicle by their description and SI unit."""
    if not isinstance(obj, type) or not issubclass(obj, BaseModel):
        return
    units = getattr(obj, "si_units", {})
    found = {
        key: field.description + (f" SI unit: {units[key]}." if key in units else "")
        for key, field in obj.model_fields.items()
        if field.description
    }
    if found:
        lines += ["", "Args:", *(f"    {key}: {text}" for key, text in found.items())]


def setup(app: Sphinx) -> dict[str, Any]:
    app.connect("builder-inited", write_pages)
    app.connect("source-read", add_lists)
    app.connect("autodoc-process-docstring", quote_blocks, priority=400)  # before napoleon
    app.connect("autodoc-process-docstring", keep_sentences, priority=499)
    app.connect("autodoc-process-docstring", restore_sentences, priority=501)
    app.connect("autodoc-process-docstring", describe_fields, priority=401)
    app.connect("autodoc-process-signature", plain_types, priority=900)  # after the types are recorded
    return {"parallel_read_safe": True}
