"""The tables of settings, from the fields of the settings and the sentence that documents each."""

from collections.abc import Iterator, Mapping
from dataclasses import fields
from typing import Any

from sphinx.application import Sphinx
from sphinx.pycode import ModuleAnalyzer

import fifthwheel as fw
from fifthwheel.filters.relinearised import RelinearisationSettings
from fifthwheel.identify.design import DesignSettings
from fifthwheel.settings import Settings, options_of

LONG = 60
"""A default with more characters stands below its table."""


def reference() -> Iterator[str]:
    """Markdown of all settings."""
    yield from chapter("OneStage", fw.OneStage())
    yield from chapter("LearnerSettings", fw.LearnerSettings())
    yield from chapter("RelinearisationSettings", RelinearisationSettings())
    yield from chapter("TwoStage", fw.TwoStage(), article=fw.article())
    yield from chapter("ObserverSettings", fw.ObserverSettings())
    yield from chapter("DesignSettings", DesignSettings())


def chapter(title: str, settings: Settings, **presets: Settings) -> Iterator[str]:
    """A heading and the table of one class; a preset has a column with the values that it changes."""
    meanings = described(type(settings))
    yield f"## {title}\n\n| field | default | {''.join(f'`{name}()` | ' for name in presets)}meaning |"
    yield f"|---|---|{'---|' * len(presets)}---|"
    below = []
    for field in fields(settings):
        value = getattr(settings, field.name)
        changed = [getattr(preset, field.name) for preset in presets.values()]
        cells = [f"`{field.name}`", shown(value), *("" if v == value else shown(v) for v in changed)]
        if isinstance(value, Mapping) and len(repr(value)) > LONG:
            cells[1] = "below"
            below.append(f"\n`{field.name}`:\n\n```python\n{lines(value)}\n```")
        yield "| " + " | ".join([*cells, meanings[field.name].replace("|", r"\|")]) + " |"
    yield "\n".join(below) + "\n"


def shown(value: Any) -> str:
    """A number without the digits of a conversion of units, other settings by their name."""
    if isinstance(value, Settings):
        return f"`{type(value).__name__}()`"
    if isinstance(value, tuple):
        return "`(" + ", ".join(shown(item).strip("`") for item in value) + ")`"
    return f"`{value:.4g}`" if isinstance(value, float) and value < 1e4 else f"`{value!r}`"


def lines(value: Mapping[str, Any]) -> str:
    return "{\n" + "".join(f"    {key!r}: {item!r},\n" for key, item in value.items()) + "}"


def described(kind: type[Settings]) -> dict[str, str]:
    """What each field means: its docstring, else its help on the command line."""
    found = {name: option.help for name, option in options_of(kind).items()}
    for base in reversed(kind.__mro__[:-1]):
        analyzer = ModuleAnalyzer.for_module(base.__module__)
        analyzer.analyze()
        for (owner, name), text in analyzer.attr_docs.items():
            if owner == base.__qualname__:
                found[name] = " ".join(text).strip()
    missing = [field.name for field in fields(kind) if not found.get(field.name)]
    if missing:
        raise ValueError(f"{kind.__name__}: no docstring of {', '.join(missing)}; add one below the field")
    return found


def add_reference(app: Sphinx, document: str, source: list[str]) -> None:
    if document == "settings":
        source[0] += "\n" + "\n".join(reference())


def setup(app: Sphinx) -> dict[str, Any]:
    app.connect("source-read", add_reference)
    return {"parallel_read_safe": True}
