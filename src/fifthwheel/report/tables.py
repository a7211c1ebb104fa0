"""Tables and text blocks of a report, as HTML."""

from collections.abc import Iterable, Mapping, Sequence
from html import escape
from typing import TYPE_CHECKING

from fifthwheel.report import advice, facts
from fifthwheel.report.numbers import digits, fixed, pair, percent, relative, seconds, shown, with_sigma
from fifthwheel.report.words import Conclusion, mark

if TYPE_CHECKING:
    from fifthwheel.identify import Estimate, Identification
    from fifthwheel.logs import Record
    from fifthwheel.report.facts import Drive


def path(name: str) -> str:
    """The path of a parameter or signal; it may break behind a dot."""
    return f"<code>{escape(name).replace('.', '.<wbr>')}</code>"


def conclusion(told: Conclusion) -> str:
    """The verdict box."""
    kind = "verdict good" if told.good else "verdict"
    parts = [f'<section class="{kind}" id="verdict"><p class="headline">{escape(told.headline)}</p><div class="lists">']
    for title, lines, tag in (
        ("Found", told.found, "ul"),
        ("Not known", told.unknown, "ul"),
        ("What to do next", told.next_steps, "ol"),
        ("Beware", told.cautions, "ul"),
        ("Notes", told.notes, "ul"),
    ):
        if lines:
            items = "".join(f"<li>{_unbroken(escape(line))}</li>" for line in lines)
            parts.append(f"<div><h3>{title}</h3><{tag}>{items}</{tag}></div>")
    return "\n".join([*parts, "</div></section>"])


def _unbroken(text: str) -> str:
    """No line ends between a number and its sigma or percent sign."""
    return text.replace(" ± ", "\u00a0±\u00a0").replace(" %", "\u00a0%")


def estimates(found: "Sequence[Estimate]", *, history: bool = True) -> str:
    """Parameters, or what follows from them, a row each."""
    heads = ["Parameter", "Verdict", "Value:n", "± sigma:n", "± %:n", "Unit", "Initial:n"]
    rows = []
    for e in found:
        unit = shown(e.unit)
        value, sigma = pair(e.value * unit.factor, None if e.sigma is None else e.sigma * unit.factor)
        sign, word = mark(e)
        cells = [
            path(e.name),
            f'<span class="{e.verdict}"><span class="mark">{sign}</span>{word}</span>:w',
            f"{value}:n",
            f"{sigma or '–'}:n",
            f"{escape(relative(e.value, e.sigma).removesuffix(' %'))}:n",
            f"{escape(unit.name)}:w",
            f"{digits(e.initial * unit.factor, exact=True)}:n",
        ]
        if history:
            cells.append(f"{seconds(e.settled)}:n")
        rows.append(("" if e.verdict == "converged" else "off", cells))
    return _table([*heads, "Settled after:n"] if history else heads, rows)


def sensors(identification: "Identification") -> str:
    """Zeros, gains and delays beside what is usual; unusual ones are marked."""
    rows = []
    for error in identification.sensors:
        signal, _, word = error.name.rpartition(".")
        mean, prior = advice.sensor_prior(identification.settings, error.name)
        odd = advice.unusual(identification.settings, error)
        cells = [
            path(signal),
            f"{'zero' if word == 'offset' else word}:w",
            escape(error.log) if error.log is not None else "all",
            f"{escape(with_sigma(error.value, error.sigma, error.unit))}:n",
            f"{escape(with_sigma(mean, prior, error.unit))}:n",
            "! unusual:w" if odd else "",
        ]
        rows.append(("warn" if odd else "", cells))
    return _table(["Signal", "Error", "Log", "Found:n", "Expected beforehand:n", ""], rows)


def logs(identification: "Identification", records: "Sequence[Record]", drives: "Sequence[Drive]") -> str:
    """What was used of every log, and how it was driven."""
    by_name = {drive.name: drive for drive in drives}
    rows = []
    for log in identification.logs:
        drive = by_name.get(log.name)
        worst = max(log.rejected.items(), key=lambda item: item[1], default=None)
        cells = [
            escape(log.name),
            "identified on",
            f"{log.span[0]:.1f} to {log.span[1]:.1f}:n",
            f"{fixed(log.samples, 0)}:n",
            f"{seconds(log.used)}:n",
            f"{advice.kmh(log.speed)}:n",
            f"{_acceleration(drive)}:n",
            "none" if worst is None or worst[1] == 0 else f"{percent(worst[1])} of {path(worst[0])}",
        ]
        rows.append(("", cells))
    used = {log.name for log in identification.logs}
    rows += [("", _plain_log(r, by_name.get(r.name), "predicted only")) for r in records if r.name not in used]
    return _table([*_LOG_HEADS, "Not used, at most"], rows)


_LOG_HEADS = ["Log", "Use", "Span, s:n", "Samples:n", "Fast enough:n", "Speed:n", "Sideways, m/s²:n"]


def plain_logs(records: "Sequence[Record]", drives: "Sequence[Drive]") -> str:
    """Logs of which only the states were estimated."""
    rows = [("", _plain_log(r, d, "states")[:-1]) for r, d in zip(records, drives, strict=True)]
    return _table(_LOG_HEADS, rows)


def _plain_log(record: "Record", drive: "Drive | None", use: str) -> list[str]:
    speed = "–" if drive is None else advice.kmh(drive.speed)
    first, last = record.span
    span = f"{first:.1f} to {last:.1f}:n"
    return [
        escape(record.name),
        use,
        span,
        f"{fixed(len(record), 0)}:n",
        "–:n",
        f"{speed}:n",
        f"{_acceleration(drive)}:n",
        "–",
    ]


def _acceleration(drive: "Drive | None") -> str:
    return "–" if drive is None or drive.acceleration != drive.acceleration else f"{drive.acceleration:.2f}"


def statuses(shares: Mapping[str, float], colours: Mapping[str, str]) -> str:
    """How much of a record is in which status, with the colour of its shade."""
    names = {word: name for name, word in facts.WORDS.items()}
    told = []
    for word, part in shares.items():
        colour = colours.get(names.get(word, ""), "")
        swatch = f'<span class="swatch" style="background:{colour}"></span>' if colour else ""
        told.append(f"{swatch}{percent(part)} {escape(word)}")
    return f'<p class="hint">Samples: {", ".join(told)}.</p>'


def settings(values: Mapping[str, object]) -> str:
    """Every setting with its value."""
    return "<dl>" + "".join(f"<dt>{path(k)}</dt><dd>{escape(str(v))}</dd>" for k, v in values.items()) + "</dl>"


def _table(heads: Sequence[str], rows: Iterable[tuple[str, Sequence[str]]]) -> str:
    """Heads and cells are HTML; an ending ":n" is a number, ":w" does not break."""
    head = "".join(_cell("th", text) for text in heads)
    body = "".join(
        f'<tr class="{kind}">' * bool(kind) + "<tr>" * (not kind) + "".join(_cell("td", c) for c in cells) + "</tr>\n"
        for kind, cells in rows
    )
    return f'<div class="scroll"><table><thead><tr>{head}</tr></thead><tbody>\n{body}</tbody></table></div>'


def _cell(tag: str, text: str) -> str:
    for ending in ("n", "w"):
        if text.endswith(f":{ending}"):
            return f'<{tag} class="{ending}">{text[:-2]}</{tag}>'
    return f"<{tag}>{text}</{tag}>"
