"""The text of a signals.toml with some entries changed; comments and other entries stay."""

from collections.abc import Mapping
from typing import Any

import tomlkit
from tomlkit.items import AbstractTable

from fifthwheel.channels import REFERENCE, split_header
from fifthwheel.logs.signal_map import SignalMap, SignalSource


def with_channel(text: str, signal: str, **keys: Any) -> str:
    """The map with keys of a signal changed, such as sign, unit, delay; a key with its default value is left out.

    The table of the signal is added if it is missing. A SignalError if the changed map is not accepted.
    """
    document = tomlkit.parse(text)
    holder, key = _holder(document, signal)
    entry = holder.get(key)
    if isinstance(entry, str):
        table: Any = tomlkit.inline_table()
        table["column"] = str(entry)
        holder[key] = table
    elif entry is None:
        holder[key] = tomlkit.table()
    defaults = {name: field.default for name, field in SignalSource.model_fields.items()}
    for name, value in keys.items():
        if value == defaults.get(name, object()) or value is None:
            holder[key].pop(name, None)
        else:
            holder[key][name] = value
    return _checked(document)


def without_channel(text: str, signal: str) -> str:
    """The map without a signal; if its column has the name of the signal, the column is ignored from then on."""
    document = tomlkit.parse(text)
    holder, key = _holder(document, signal)
    entry = holder.pop(key, None)
    column = entry.get("column") if isinstance(entry, Mapping) else entry
    ignored = document.get("ignore", [])
    if column is not None and split_header(str(column))[0].removeprefix(REFERENCE) == signal:
        document["ignore"] = [*ignored, signal]
        if list(document)[-1] == "ignore":  # a key after a table would belong to it
            moved = tomlkit.document()
            moved["ignore"] = document.pop("ignore")
            document = tomlkit.parse(tomlkit.dumps(moved) + tomlkit.dumps(document))
    return _checked(document)


def _holder(document: Any, signal: str) -> tuple[Any, str]:
    """The table that has a signal, and its key there: "yaw_rate.tractor" may be written as nested tables."""
    part = "reference" if signal in SignalMap.parse(tomlkit.dumps(document)).reference else "signals"
    holder = document.setdefault(part, tomlkit.table(is_super_table=True))
    rest = signal
    while rest not in holder:
        first, _, last = rest.partition(".")
        if not last or not isinstance(holder.get(first), AbstractTable):
            break
        holder, rest = holder[first], last
    return holder, rest


def _checked(document: Mapping[str, Any]) -> str:
    text = tomlkit.dumps(document)
    SignalMap.parse(text)
    return text
