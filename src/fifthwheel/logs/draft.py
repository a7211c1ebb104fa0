"""A proposal as a signals.toml that a person edits."""

import json

from fifthwheel.logs.propose import Proposal
from fifthwheel.logs.survey import Survey


def as_toml(proposal: Proposal, found: Survey) -> str:
    """The proposal as a signals.toml, with its reasons as comments, ready to be edited."""
    proposed = proposal.signals
    lines = [f"# Proposed for {found.name} by names, units and samples. Look at every line before you believe it."]
    if proposed.databases:
        lines.append(f"databases = [{', '.join(_quoted(str(path)) for path in proposed.databases)}]")
    if proposed.time is not None:
        lines += ["", "[time]", f"column = {_quoted(proposed.time.column or '')}"]
    for part, channels in (("signals", proposed.signals), ("reference", proposed.reference)):
        for signal, channel in channels.items():
            content = found.contents[channel.column or ""] if channel.column in found.contents else None
            lines += ["", f"[{part}.{_quoted(signal)}]", *_comment(proposal.reasons[signal])]
            lines.append(f"column = {_quoted(channel.column or '')}")
            unit = channel.unit or (content.column.unit if content else None)
            if unit is not None:
                lines.append(f"unit = {_quoted(unit)}")
            lines += [f"sign = {channel.sign}"] * (channel.sign != 1)
            lines += [f"gain = {channel.gain:g}"] * (channel.gain != 1.0)
            lines += [f"# or column = {_quoted(other)}" for other in proposal.others.get(signal, ())]
    for signal, columns in proposal.others.items():
        if signal not in proposed.signals and signal not in proposed.reference:
            lines += ["", f"# [signals.{_quoted(signal)}], to weigh the truck:"]
            lines += [f"# column = {_quoted(column)}" for column in columns]
    lines += ["", *(f"# {text}" for text in proposal.missing)] if proposal.missing else []
    lines += (
        ["", *(f"# {line}" for one in proposal.findings for line in str(one).splitlines())] if proposal.findings else []
    )
    return "\n".join(lines) + "\n"


def _comment(reason: str) -> list[str]:
    return [f"# {part}" for part in reason.split("; ")]


def _quoted(text: str) -> str:
    return json.dumps(text, ensure_ascii=False)
