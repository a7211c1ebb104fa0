"""The report: everything that is known about a truck, on one page that opens without a network."""

from collections.abc import Iterator, Sequence
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

import fifthwheel
from fifthwheel.report import facts, figures, page, tables
from fifthwheel.report.figures import Plot
from fifthwheel.report.numbers import about, percent, with_sigma
from fifthwheel.report.words import Conclusion, conclude, conclude_states, innovation_size

if TYPE_CHECKING:
    from fifthwheel.identify import Fit, Identification
    from fifthwheel.logs import Record
    from fifthwheel.observe import States


def write_report(
    path: Path,
    identification: "Identification | None",
    records: "Sequence[Record]",
    states: "Sequence[States]",
    *,
    title: str,
) -> None:
    """Write an identification, or states alone, as one HTML file, whole or not at all.

    Args:
        identification: None when only states were estimated.
        records: the logs, those included that were only predicted; states and fits belong to them by name.
        states: of any of the records.
        title: usually the vehicle's name.
    """
    report = _Report()
    report.build(identification, records, states, title)
    page.write(Path(path), title=f"{title}: fifthwheel", body="\n".join(report.body), plots=report.plots)


class _Report:
    def __init__(self) -> None:
        self.body: list[str] = []
        self.plots: list[Plot] = []

    def build(
        self,
        identification: "Identification | None",
        records: "Sequence[Record]",
        states: "Sequence[States]",
        title: str,
    ) -> None:
        """The whole body, in the order in which it is read."""
        self.body.append(f"<h1>{escape(title)}</h1>")
        if identification is not None:
            self._say("subtitle", f"{_method(identification)}, fifthwheel {identification.version}")
            self._contents(conclude(identification, records), states, identified=True)
            self._parameters(identification)
            self._histories(identification)
            self._fits(identification)
        else:
            self._say("subtitle", f"States of a known truck, fifthwheel {fifthwheel.__version__}")
            self._contents(conclude_states(states, records), states, identified=False)
        if states:
            self._states(states, records)
            self._innovations(states)
        self._end(identification, records)

    def _contents(self, told: Conclusion, states: "Sequence[States]", *, identified: bool) -> None:
        links = [("parameters", "Parameters"), ("histories", "Histories"), ("fits", "Measured and predicted")]
        links = links if identified else []
        links += [("states", "States"), ("innovations", "Innovations")] if states else []
        links.append(("logs", "Logs and settings" if identified else "Logs"))
        self.body.append("<nav>" + "".join(f'<a href="#{key}">{text}</a>' for key, text in links) + "</nav>")
        self.body.append(tables.conclusion(told))

    def _parameters(self, found: "Identification") -> None:
        self._heading("parameters", "Parameters")
        self._say(
            "hint",
            "Sigma is one standard deviation, from the logs and what was assumed beforehand. Values in grey are no "
            "findings: the vehicle file's, or those where the search began. Settled after: driving time"
            f"{'' if found.method == 'one-stage' else ', in the last pass,'} from which the value stayed within "
            f"{percent(found.settings.tolerance)} of its average (–: never).",
        )
        self.body.append(tables.estimates(found.parameters))
        if found.derived:
            self.body.append("<h3>What follows from the load</h3>")
            self._say("hint", "CoG of the laden sprung body above the ground; its roll inertia about the roll axis.")
            self.body.append(tables.estimates(found.derived, history=False))
        if found.rough:
            self.body.append("<h3>Known roughly beforehand</h3>")
            self._say(
                "hint",
                "The vehicle file is not taken to the last digit: what is held keeps its value and counts in every "
                "sigma above, the others were learned beside, from what was assumed of them.",
            )
            self.body.append(tables.estimates(found.rough, history=False))
        if found.sensors:
            self.body.append("<h3>Errors of the sensors</h3>")
            self._say(
                "hint",
                "Estimated beside the parameters: a sensor shows the truth plus its zero; wheels turn by gain × "
                "(shown − zero).",
            )
            self.body.append(tables.sensors(found))
        banks = [f"{log.name} {with_sigma(*log.bank, 'rad')}" for log in found.logs if log.bank]
        if banks:
            self._say("hint", f"Bank of the road, left edge higher: {'; '.join(banks)}.")

    def _histories(self, found: "Identification") -> None:
        self._heading("histories", "Histories of the parameters")
        later = (
            f" All {found.rounds} rounds are shown; in the first, stage 1 knows no roll and is off by what that moves."
        )
        self._say(
            "hint",
            "What the logs had said of each parameter by then, taken together from the start on, for all unknowns at "
            "once; the band is one sigma as it would be if the model were right."
            if found.method == "one-stage"
            else "Each parameter while the filter drives through the logs, again and again; grey vertical lines part "
            f"the passes. A pass begins at the last one's value with the prior's width, and ends, in a last step, with "
            f"the prior's mean put back. The band is one sigma as the filter has it; that of the table also counts "
            f"residuals that hang together, and is wider.{later if found.rounds > 1 else ''}",
        )
        for title, trace in found.traces.items():
            sought = [e for e in found.parameters if e.name in trace.names]
            passes = "" if found.method == "one-stage" else f": {trace.passes} pass{'es' * (trace.passes > 1)}"
            self.body.append(f"<h3>{escape(title.capitalize())}{passes}</h3>")
            if not sought:
                self._say("hint", "No parameter of this stage was excited enough to be sought.")
                continue
            self._plots(
                (
                    tables.path(e.name),
                    f"final {escape(with_sigma(e.value, e.sigma, e.unit))}",
                    figures.history(trace, e, f"history {title}"),
                )
                for e in sought
            )
        without = [e.name for e in found.parameters if not any(e.name in t.names for t in found.traces.values())]
        if without and len(without) < len(found.parameters):
            self._say("hint", f"Not sought, so without a history: {', '.join(without)}.")

    def _fits(self, found: "Identification") -> None:
        self._heading("fits", "Measured and predicted")
        self._say(
            "hint",
            "The identified truck runs free on speed and steer angle alone. Explained: the part of the channel's "
            "variance that it gives. Noise cannot be explained; a residual about as large as the sensor's noise is as "
            "good as it gets, a slow wave in it is something that the model does not have.",
        )
        for log in dict.fromkeys(fit.log for fit in found.fits):
            own = [fit for fit in found.fits if fit.log == log]
            badge = "" if own[0].identified_on else ' <span class="badge">predicted only</span>'
            self.body.append(f"<h3>{escape(log)}{badge}</h3>")
            self._plots(_fit_plots(own))

    def _states(self, states: "Sequence[States]", records: "Sequence[Record]") -> None:
        self._heading("states", "States")
        self._say(
            "hint",
            "Estimated from the sensors, with a band of two sigma (95 %), which takes the vehicle and the sensors' "
            "zeros for exact unless their uncertainty was given. Measured values are as logged, zeros included. "
            "Shaded: not reliable.",
        )
        for one in states:
            record = facts.record_of(one, records)
            self.body.append(f"<h3>{escape(one.name)}</h3>")
            self.body.append(tables.statuses(facts.status_shares(one), figures.STATUS_COLOURS))
            rows = []
            for name in one.values:
                unit = facts.unit_of(name)
                rms = facts.reference_rms(one, record, name)
                band = facts.median_band(one, name)
                note = "never reliable" if band is None else f"± {about(band, unit)} (2 sigma, median)"
                note += "" if rms is None else f"; rms difference from the reference {about(rms, unit)}"
                rows.append(
                    (tables.path(name), escape(note), figures.state(one, record, name, f"log {one.name}", unit))
                )
            self._plots(iter(rows))

    def _innovations(self, states: "Sequence[States]") -> None:
        self._heading("innovations", "Innovations")
        self._say(
            "hint",
            "Measurement less prediction, in units of the standard deviation that the filter expects: 95 % should lie "
            "between the dashed lines, without a pattern, and the rms should be 1.",
        )
        for one in states:
            self.body.append(f"<h3>{escape(one.name)}</h3>")
            rows = []
            for name in one.innovation:
                size, out = innovation_size(one, name)
                note = f"rms {size:.2f}, {percent(out)} not used" if size == size else "never used"
                rows.append((tables.path(name), escape(note), figures.innovation(one, name, f"log {one.name}")))
            self._plots(iter(rows))

    def _end(self, found: "Identification | None", records: "Sequence[Record]") -> None:
        self._heading("logs", "Logs" if found is None else "Logs and settings")
        self._say("hint", "Sideways: speed times yaw rate, held for half a second, at its greatest.")
        if found is None:
            self.body.append(tables.plain_logs(records, facts.drives(records, None, {}, 5.0)))
            return
        self.body.append(tables.logs(found, records, facts.driven(found, records)))
        self.body.append("<details><summary>Settings and version</summary>")
        word = "steps" if found.method == "one-stage" else "rounds"
        self._say("hint", f"fifthwheel {found.version}, {_method(found)}; {found.rounds} {word}.")
        self.body.append(tables.settings(found.settings.as_dict()))
        self.body.append("</details>")

    def _plots(self, rows: Iterator[tuple[str, str, Plot]]) -> None:
        """Figures with their captions (HTML) side by side."""
        self.body.append('<div class="plots">')
        for caption, note, plot in rows:
            place = f'<div class="plot{" tall" if plot.tall else ""}" id="plot{len(self.plots)}"></div>'
            self.body.append(f"<figure><figcaption>{caption}<small>{note}</small></figcaption>{place}</figure>")
            self.plots.append(plot)
        self.body.append("</div>")

    def _heading(self, key: str, text: str) -> None:
        self.body.append(f'<h2 id="{key}">{text}</h2>')

    def _say(self, kind: str, text: str) -> None:
        self.body.append(f'<p class="{kind}">{escape(text)}</p>')


def _fit_plots(own: "Sequence[Fit]") -> Iterator[tuple[str, str, Plot]]:
    for fit in own:
        unit = facts.unit_of(fit.signal)
        share = facts.share(fit)
        caption = f"{tables.path(fit.signal)}: {percent(max(fit.explained, 0.0), of_whole=True)} explained"
        note = f"residual {about(fit.rms, unit)} rms"
        if share.noise == share.noise:
            note += f", sensor noise about {about(share.noise, unit)}"
            note += "; no more can be explained" if share.by_noise else ""
        yield caption, escape(note), figures.fit(fit, f"log {fit.log}", unit)


def _method(found: "Identification") -> str:
    return f"Identified {found.method}, preset {found.settings.preset}"
