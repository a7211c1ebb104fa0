"""The text of a signals.toml: of a proposal, and with some entries changed, where comments and other entries stay."""

import hashlib
import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import tomlkit
from tomlkit.items import AbstractTable

from fifthwheel.base.errors import printable, printable_lines
from fifthwheel.base.units import split_statement
from fifthwheel.data.channels import SensorErrorName, split_header, split_reference
from fifthwheel.data.logs.propose import MapProposal
from fifthwheel.data.logs.signal_map import SignalMap, SignalSource
from fifthwheel.data.logs.survey import LogSurvey

_UNCHANGED = "# A new proposal replaces this file as long as it is not edited: "


def as_toml(proposal: MapProposal, survey: LogSurvey) -> str:
    """The proposal as a signals.toml for the user to edit, with its reasons as comments."""
    proposed = proposal.signals
    lines = _comments([f"Proposed for {printable(survey.name)} by names, units and samples. Check every line."])
    if proposed.databases:
        lines.append(f"databases = [{', '.join(_quoted(str(path)) for path in proposed.databases)}]")
    if proposed.time.column is not None:
        lines += ["", "[time]", f"column = {_quoted(proposed.time.column)}"]
    for part, channels in (("signals", proposed.signals), ("reference", proposed.reference)):
        for signal, channel in channels.items():
            content = survey.contents.get(channel.column or "")
            unit = channel.unit or (content.column.unit if content else None)
            lines += ["", f"[{part}.{_quoted(signal)}]", *_comments(proposal.reasons[signal].split("; "))]
            lines.append(f"column = {_quoted(channel.column or '')}")
            lines += [f"unit = {_quoted(unit)}"] if unit is not None else []
            lines += [f"sensor = {_quoted(channel.sensor)}"] if channel.sensor else []
            lines += [f"sign = {channel.sign}"] if channel.sign != 1 else []
            changed = [key for key, default in (("gain", 1.0), ("delay", 0.0)) if getattr(channel, key) != default]
            for key, text in ((key, channel.text_of(key)) for key in changed):
                lines.append(f"{key} = {_quoted(text) if '+-' in text else text}")
            lines += ["derivative = true"] if channel.derivative else []
            lines += _comments(f"or column = {_quoted(other)}" for other in proposal.others.get(signal, ()))
    for signal, columns in proposal.others.items():
        if signal not in proposed.signals and signal not in proposed.reference:
            lines += ["", f"# [signals.{_quoted(signal)}], for on-board weighing:"]
            lines += _comments(f"column = {_quoted(column)}" for column in columns)
    findings = [line for finding in proposal.findings for line in str(finding).splitlines()]
    for paragraph in (proposal.missing, findings):
        lines += ["", *_comments(paragraph)] if paragraph else []
    text = "\n".join(lines) + "\n"
    return f"{text}\n{_UNCHANGED}{_digest(text)}\n"


def is_unchanged(path: Path | None) -> bool:
    """Whether a file is a proposal that nobody has edited."""
    text = path.read_bytes().decode(errors="replace") if path and path.is_file() else ""
    proposed, mark, digest = text.rpartition(f"\n{_UNCHANGED}")
    return bool(mark) and digest == f"{_digest(proposed)}\n"


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()[:12]


def _comments(texts: Iterable[str]) -> list[str]:
    return [f"# {line}" for text in texts for line in printable_lines(text).split("\n")]


def _quoted(text: str) -> str:
    """A text as a string of TOML."""
    return printable(json.dumps(text, ensure_ascii=False))


def with_channel(text: str, signal: str, **keys: Any) -> str:
    """The map with keys of a signal changed, such as sign, unit, delay; a key with its default value is left out.

    The uncertainty of a number, as in "0.05 +- 2 %", stays. The table of the signal is added if it is missing. A
    SignalError if the changed map is not accepted.
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
    for name, given in keys.items():
        default = SignalSource.model_fields[name].default
        value = default if given is None else given
        value = _with_sigma(holder[key].get(name), value, signal, name) or value
        if value == default:
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
    if column is not None and split_reference(split_header(str(column))[0])[0] == signal:
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


def _with_sigma(old: Any, value: Any, signal: str, key: str) -> str | None:
    """Another value with the "+- ..." of an old text; None where the old one has none, or the new one is a text."""
    number, mark, sigma = split_statement(old) if isinstance(old, str) else ("", "", "")
    if not mark or isinstance(value, str):
        return None
    without_unit = key == "gain" or number.replace(".", "").isdigit()
    unit = "" if without_unit else f" {SensorErrorName(signal, key).unit}"
    return f"{value:.12g}{unit} {mark} {sigma}".rstrip()


def _checked(document: Mapping[str, Any]) -> str:
    text = tomlkit.dumps(document)
    SignalMap.parse(text)
    return text
