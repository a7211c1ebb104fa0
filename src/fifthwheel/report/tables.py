"""Tables and text blocks of a report, as HTML."""

from collections.abc import Mapping, Sequence
from html import escape
from typing import TYPE_CHECKING

from fifthwheel.report import cautions, facts
from fifthwheel.report.conclusion import Conclusion
from fifthwheel.report.numbers import fixed, kmh, pair, percent, relative, seconds, shown, with_sigma
from fifthwheel.report.provenance import Provenance
from fifthwheel.report.table import Column, path, table
from fifthwheel.report.words import mark

if TYPE_CHECKING:
    from fifthwheel.identify import Estimate, Identification
    from fifthwheel.logs import Record
    from fifthwheel.report.facts import Drive


def conclusion(told: Conclusion) -> str:
    """The verdict box."""
    kind = "verdict good" if told.good else "verdict"
    parts = [f'<section class="{kind}" id="verdict"><p class="headline">{escape(told.headline)}</p><div class="lists">']
    columns = (
        (("Found", told.found, "ul"), ("Not known", told.unknown, "ul")),
        (("What to do next", told.next_steps, "ol"), ("Beware", told.cautions, "ul"), ("Notes", told.notes, "ul")),
    )
    for column in columns:
        parts.append("<div>")
        for title, lines, tag in column:
            if lines:
                items = "".join(f"<li>{_unbroken(escape(line))}</li>" for line in lines)
                parts.append(f"<h3>{title}</h3><{tag}>{items}</{tag}>")
        parts.append("</div>")
    return "\n".join([*parts, "</div></section>"])


def _unbroken(text: str) -> str:
    """No line ends between a number and its sigma or percent sign."""
    return text.replace(" ± ", "\u00a0±\u00a0").replace(" %", "\u00a0%")


NAME, VERDICT = Column("Parameter", "name"), Column("Verdict", "full")
ESTIMATES = (
    NAME,
    VERDICT,
    Column("Value", "n main"),
    Column("± sigma", "n main", "± "),
    Column("Unit", "w main"),
    Column("relative", "n"),
    Column("Before", "n full", "before "),
)


def estimates(found: "Sequence[Estimate]", *, history: bool = True) -> str:
    """Parameters, or what follows from them, a row each: what is known now, and what was assumed before."""
    rows = []
    for e in found:
        unit = shown(e.unit)
        value, sigma = pair(e.value * unit.factor, None if e.sigma is None else e.sigma * unit.factor)
        before, spread = pair(e.initial * unit.factor, None if e.prior is None else e.prior * unit.factor)
        sign, word = mark(e)
        cells = [
            path(e.name),
            f'<span class="{e.verdict}"><span class="mark">{sign}</span>{word}</span>',
            value,
            sigma or "–",
            escape(unit.name),
            escape(relative(e.value, e.sigma)),
            before if spread is None else f"{before} ± {spread}",
        ]
        rows.append(("" if e.verdict == "converged" else "off", [*cells, seconds(e.settled)] if history else cells))
    return table([*ESTIMATES, Column("Settled after", "n", "settled after ")] if history else ESTIMATES, rows)


def sensors(identification: "Identification") -> str:
    """Zeros, gains and delays beside what is usual; unusual ones are marked."""
    rows = []
    for error in identification.sensors:
        signal, _, word = error.name.rpartition(".")
        mean, prior = cautions.sensor_prior(identification.settings, error.name)
        odd = cautions.unusual(identification.settings, error)
        cells = [
            path(signal),
            "zero" if word == "offset" else word,
            escape(error.log) if error.log is not None else "all logs",
            escape(with_sigma(error.value, error.sigma, error.unit)),
            escape(with_sigma(mean, prior, error.unit)),
            "! unusual" if odd else "",
        ]
        rows.append(("warn" if odd else "", cells))
    heads = (
        Column("Signal", "name"),
        Column("Error", "w"),
        Column("Log"),
        Column("Found", "n", "found "),
        Column("Expected beforehand", "n", "expected "),
        Column("", "w"),
    )
    return table(heads, rows)


LOGS = (
    Column("Log", "name"),
    Column("Use", "w"),
    Column("Span, s", "n", "span, s: "),
    Column("Samples", "n", "samples: "),
    Column("Fast enough", "n", "fast enough: "),
    Column("Speed", "n", "speed: "),
    Column("Sideways, m/s²", "n", "sideways, m/s²: "),
    Column("Not used, at most", "", "not used, at most: "),
)


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
            f"{log.span[0]:.1f} to {log.span[1]:.1f}",
            fixed(log.samples, 0),
            seconds(log.used),
            kmh(log.speed),
            _acceleration(drive),
            "none" if worst is None or worst[1] == 0 else f"{percent(worst[1])} of {path(worst[0])}",
        ]
        rows.append(("", cells))
    used = {log.name for log in identification.logs}
    rows += [("", _plain_log(r, by_name.get(r.name), "predicted only")) for r in records if r.name not in used]
    return table(LOGS, rows)


def plain_logs(records: "Sequence[Record]", drives: "Sequence[Drive]") -> str:
    """Logs of which only the states were estimated."""
    return table(LOGS[:-1], [("", _plain_log(r, d, "states")[:-1]) for r, d in zip(records, drives, strict=True)])


def _plain_log(record: "Record", drive: "Drive | None", use: str) -> list[str]:
    speed = "–" if drive is None else kmh(drive.speed)
    first, last = record.span
    span = f"{first:.1f} to {last:.1f}"
    return [escape(record.name), use, span, fixed(len(record), 0), "–", speed, _acceleration(drive), "–"]


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


def provenance(told: Provenance) -> str:
    """The command, when it ran, what it read, and with which versions."""
    parts = [f'<p class="command"><code>{escape(told.command)}</code></p>'] if told.command else []
    when = f"Run at {told.time}, with " if told.time else "With "
    parts.append(f"<p>{escape(when + ', '.join(f'{name} {text}' for name, text in told.versions.items()))}.</p>")
    if told.files:
        heads = (Column("File", "name"), Column("Bytes", "n", "bytes: "), Column("SHA-256", "full"))
        rows = [("", [path(f.path), fixed(f.size, 0), f'<code class="hash">{f.sha256}</code>']) for f in told.files]
        parts.append(table(heads, rows))
    for name, text in told.texts.items():
        parts.append(f"<details><summary>{escape(name)}</summary><pre>{escape(text)}</pre></details>")
    return "\n".join(parts)
