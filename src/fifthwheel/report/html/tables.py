"""Tables and boxes of a report, as HTML. On a narrow screen each row of a table becomes a card."""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from html import escape

from fifthwheel.channels import SensorErrorName
from fifthwheel.diagnose.cautions import is_unusual, sensor_error_prior
from fifthwheel.diagnose.information_summary import ParameterInformation
from fifthwheel.diagnose.run_summary import RunSummary
from fifthwheel.formatting import fixed, kmh, percent, relative, seconds, shown, value_and_sigma, with_sigma
from fifthwheel.identify import Estimate, Identification, Verdict
from fifthwheel.record import Record
from fifthwheel.report.provenance import Provenance
from fifthwheel.report.text.conclusion import Conclusion
from fifthwheel.report.text.words import STATUSES, mark, spoken_role
from fifthwheel.vehicle import Vehicle, unit_of


@dataclass(frozen=True)
class Column:
    """A column of a table."""

    head: str
    css_class: str = ""
    """"name" and "full" have their own line on a card, "main" is bold there, "n" is a number, "w" does not break."""
    label: str = ""  # text before the cell on a card, which has no head


def code(name: str) -> str:
    """The path of a parameter, signal or file; it may break after a dot or a slash."""
    return f"<code>{escape(name).replace('.', '.<wbr>').replace('/', '/<wbr>')}</code>"


def table(columns: Sequence[Column], rows: Iterable[tuple[str, Sequence[str]]]) -> str:
    """A table.

    Args:
        rows: CSS class and cells, which are HTML.
    """
    head = "".join(f"<th{_attribute('class', c.css_class)}>{escape(c.head)}</th>" for c in columns)
    body = "".join(
        f"<tr{_attribute('class', css_class)}>{''.join(map(_cell, columns, cells))}</tr>\n" for css_class, cells in rows
    )
    return f'<div class="scroll"><table><thead><tr>{head}</tr></thead><tbody>\n{body}</tbody></table></div>'


def _cell(column: Column, html: str) -> str:
    css_class = f"{column.css_class} none".strip() if html in ("", "–") else column.css_class
    return f"<td{_attribute('class', css_class)}{_attribute('data-label', column.label)}>{html}</td>"


def _attribute(name: str, value: str) -> str:
    return f' {name}="{escape(value)}"' if value else ""


def conclusion(conclusion: Conclusion) -> str:
    """The box at the top of the page."""
    css_class = "verdict good" if conclusion.good else "verdict"
    columns = (
        (("Result", conclusion.results, "ul"), ("Not identified", conclusion.not_identified, "ul")),
        (
            ("Next steps", conclusion.next_steps, "ol"),
            ("Cautions", conclusion.cautions, "ul"),
            ("Notes", conclusion.notes, "ul"),
        ),
    )
    html = [f'<section class="{css_class}" id="verdict"><p class="headline">{escape(conclusion.headline)}</p>']
    html.append('<div class="lists">')
    for column in columns:
        html += ["<div>", *[_list(title, lines, tag) for title, lines, tag in column if lines], "</div>"]
    return "\n".join([*html, "</div></section>"])


def _list(title: str, lines: Sequence[str], tag: str) -> str:
    return f"<h3>{title}</h3><{tag}>{''.join(f'<li>{_text(line)}</li>' for line in lines)}</{tag}>"


def _text(text: str) -> str:
    """A text as HTML that does not break between a number and its sigma or per cent sign, nor within an option."""
    html = escape(text).replace(" ± ", "\u00a0±\u00a0").replace(" %", "\u00a0%")
    return re.sub(r"(?<!\w)--\w[\w-]*", r'<span class="option">\g<0></span>', html)


ESTIMATES = (
    Column("Parameter", "name"),
    Column("Verdict", "full"),
    Column("Value", "n main"),
    Column("± sigma", "n main", "± "),
    Column("Unit", "w main"),
    Column("Relative", "n"),
    Column("Prior", "n full", "prior "),
)


def estimates(estimates: Sequence[Estimate], *, history: bool = True) -> str:
    """Estimates with verdict, sigma and prior; with `history` also when they settled."""
    rows = []
    for e in estimates:
        unit = shown(e.unit)
        value, sigma = value_and_sigma(e.value * unit.factor, None if e.sigma is None else e.sigma * unit.factor)
        prior, spread = value_and_sigma(e.initial * unit.factor, None if e.prior is None else e.prior * unit.factor)
        cells = [
            code(e.name),
            f'<span class="{e.verdict}"><span class="mark">{mark(e)}</span>{spoken_role(e)}</span>',
            value,
            sigma or "–",
            escape(unit.name),
            escape(relative(e.value, e.sigma)),
            prior if spread is None else f"{prior} ± {spread}",
            *([seconds(e.settling_time)] if history else []),
        ]
        rows.append(("" if e.verdict is Verdict.CONVERGED else "off", cells))
    return table([*ESTIMATES, Column("Settled after", "n", "settled after ")] if history else ESTIMATES, rows)


ASSUMED = (Column("Parameter", "name"), Column("Value", "n main"), Column("Source", "full"))


def assumed(vehicle: Vehicle) -> str:
    """The numbers that a vehicle file leaves to vehicle classes, with their sources."""
    values = vehicle.parameters()
    return table(
        ASSUMED,
        [
            ("", [code(path), with_sigma(values[path], vehicle.stated.get(path), unit_of(path)), escape(source)])
            for path, source in vehicle.assumed.items()
        ],
    )


SENSOR_ERRORS = (
    Column("Signal", "name"),
    Column("Error", "w"),
    Column("Log"),
    Column("Estimate", "n", "estimate "),
    Column("Prior", "n", "prior "),
    Column("", "w"),
)


def sensor_errors(identification: Identification) -> str:
    """Offsets, gains and delays of the sensors with their priors; unusual ones are marked."""
    rows = []
    for error in identification.sensors:
        signal, kind = SensorErrorName.of(error.name) or (error.name, "")
        unusual = is_unusual(identification, error)
        cells = [
            code(signal),
            kind,
            escape(error.log) if error.log is not None else "all logs",
            escape(with_sigma(error.value, error.sigma, error.unit)),
            escape(with_sigma(*sensor_error_prior(identification, error.name), error.unit)),
            "! unusual" if unusual else "",
        ]
        rows.append(("warn" if unusual else "", cells))
    return table(SENSOR_ERRORS, rows)


def information(rows: Sequence[ParameterInformation]) -> str:
    """For each parameter a bar of the prior sigma that remains, and what limits its sigma."""
    html = []
    for row in rows:
        remaining = 1.0 if row.remaining is None else row.remaining
        css_class = "" if row.estimate.verdict is Verdict.CONVERGED else ' class="prior"'
        bar = f'<span class="bar" aria-hidden="true"><i{css_class} style="width:{100 * remaining:.1f}%"></i></span>'
        note = "" if row.remaining is None else f"<small>{percent(remaining)} of the prior sigma remains</small>"
        messages = "".join(f"<li>{_text(message)}</li>" for message in row.messages)
        html.append(
            f'<div class="information"><div>{code(row.estimate.name)}{bar}<b>{escape(row.change)}</b>{note}</div>'
            f"<ul>{messages}</ul></div>"
        )
    return "\n".join(html)


LOGS = (
    Column("Log", "name"),
    Column("Use", "w"),
    Column("Span, s", "n", "span, s: "),
    Column("Samples", "n", "samples: "),
    Column("Used", "n", "used: "),
    Column("Speed", "n", "speed: "),
    Column("Lateral acc., m/s²", "n", "lateral acceleration, m/s²: "),
    Column("Most rejected", "", "most rejected: "),
)


def logs(records: Sequence[Record], runs: Sequence[RunSummary], identification: Identification | None = None) -> str:
    """How each log was driven, and what an identification used of it."""
    summaries = {log.name: log for log in identification.logs} if identification else {}
    spans = {record.name: (record.span, len(record)) for record in records}
    spans |= {name: (log.span, log.samples) for name, log in summaries.items()}
    by_name = {run.name: run for run in runs}
    rows = []
    for name in dict.fromkeys([*summaries, *spans]):
        (first, last), samples = spans[name]
        log, run = summaries.get(name), by_name[name]
        use = "identification" if log else "validation" if identification else "states"
        channel, rejected = max(log.rejected.items() if log else (), key=lambda item: item[1], default=("", 0.0))
        worst = f"{percent(rejected)} of {code(channel)}" if rejected else "none"
        cells = [
            escape(name),
            use,
            f"{first:.1f} to {last:.1f}",
            fixed(samples, 0),
            seconds(log.used) if log else "–",
            kmh(log.speed if log else run.speed),
            "–" if run.acceleration != run.acceleration else f"{run.acceleration:.2f}",
            worst if log else "–",
        ]
        rows.append(("", cells if identification else cells[:-1]))
    return table(LOGS if identification else LOGS[:-1], rows)


def statuses(fractions: Mapping[str, float], colours: Mapping[str, str]) -> str:
    """Fraction of the samples by status, with the colour of its shading."""
    items = []
    for status, fraction in fractions.items():
        swatch = f'<span class="swatch" style="background:{colours[status]}"></span>' if status in colours else ""
        items.append(f"{swatch}{percent(fraction)} {escape(STATUSES[status])}")
    return f'<p class="hint">Samples: {", ".join(items)}.</p>'


def settings(values: Mapping[str, object]) -> str:
    """Every setting with its value."""
    return "<dl>" + "".join(f"<dt>{code(k)}</dt><dd>{escape(str(v))}</dd>" for k, v in values.items()) + "</dl>"


FILES = (Column("File", "name"), Column("Bytes", "n", "bytes: "), Column("SHA-256", "full"))


def provenance(provenance: Provenance) -> str:
    """Command, time, versions, files, and the texts of the vehicle file and the signal map."""
    html = [f'<p class="command"><code>{escape(provenance.command)}</code></p>'] if provenance.command else []
    when = f"Run at {provenance.time}, with " if provenance.time else "With "
    versions = ", ".join(f"{name} {version}" for name, version in provenance.versions.items())
    html.append(f"<p>{escape(f'{when}{versions}')}.</p>")
    if provenance.files:
        rows = [
            ("", [code(f.path), fixed(f.size, 0), f'<code class="hash">{f.sha256}</code>']) for f in provenance.files
        ]
        html.append(table(FILES, rows))
    for name, text in provenance.texts.items():
        html.append(f"<details><summary>{escape(name)}</summary><pre>{escape(text)}</pre></details>")
    return "\n".join(html)
