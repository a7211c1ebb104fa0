"""The sections of a report that states fill: the states, and whether residuals and innovations are noise."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING

import numpy as np

from fifthwheel.report import checks, facts, figures, tables, whiteness
from fifthwheel.report.numbers import about, percent
from fifthwheel.report.sheet import Row, Sheet
from fifthwheel.report.state_words import innovation_size
from fifthwheel.report.table import path

if TYPE_CHECKING:
    from fifthwheel.identify import Fit
    from fifthwheel.logs import Record
    from fifthwheel.observe import States


@dataclass(frozen=True, kw_only=True)
class Given:
    """How states were estimated, as far as they do not tell it themselves."""

    smoothed: bool = False
    uncertain: tuple[str, ...] = ()
    """What every sigma counts the uncertainty of: paths of the vehicle, errors of the sensors."""

    def in_words(self, *, identified: bool = False) -> str:
        """What the bands hold; `identified` when the truck was identified just now."""
        from fifthwheel.observe.uncertainty import of_sensor

        errors = len({name.partition("@")[0] for name in self.uncertain if of_sensor(name)})
        paths = sum(not of_sensor(name) for name in self.uncertain)
        if not self.uncertain and identified:
            text = "It takes the identified truck and its sensors' zeros for exact, as only one stage tells otherwise"
        elif not self.uncertain:
            text = (
                "It takes the vehicle file and the sensors' zeros for exact: give an identification.json (-i) to have "
                "their uncertainty in it"
            )
        else:
            text = (
                f"It counts the uncertainty of the truck ({paths} of its parameters) and of its sensors ({errors} "
                "errors), as the identification left them"
            )
        return f"{text}.{' Smoothed: every sample knows what came later.' if self.smoothed else ''}"


def states(
    sheet: Sheet,
    found: "Sequence[States]",
    records: "Sequence[Record]",
    given: Given | None,
    *,
    trusted: bool,
    identified: bool = False,
) -> None:
    """Every state of every log, with its band, its sensor and its reference."""
    sheet.heading("states", "States")
    held = f" {given.in_words(identified=identified)}" if given else ""
    doubt = "" if trusted else " Not to be relied on: the truck does not fit what was measured, see the top."
    sheet.hint(
        f"Estimated from the sensors, with a band of two sigma (95 %).{held} Measured values are as logged, zeros "
        f"included. Shaded: not to be used.{doubt}"
    )
    for one in found:
        record = facts.record_of(one, records)
        sheet.part(one.name)
        sheet.html(tables.statuses(facts.status_shares(one), figures.STATUS_COLOURS))
        rows = []
        for name in one.values:
            unit = facts.unit_of(name)
            rms = facts.reference_rms(one, record, name)
            band = facts.median_band(one, name)
            note = "never known" if band is None else f"± {about(band, unit)} (2 sigma, median)"
            note += "" if rms is None else f"; rms difference from the reference {about(rms, unit)}"
            rows.append((path(name), escape(note), figures.state(one, record, name, f"log {one.name}", unit)))
        sheet.figures(rows)


def consistency(sheet: Sheet, found: "Sequence[States]", fits: "Sequence[Fit]") -> None:
    """Whether what is left over is noise: innovations of the states, residuals of the identification."""
    sheet.heading("innovations", "Residuals and consistency")
    if found:
        sheet.hint(
            "Innovations: measurement less prediction of the state filter, in units of the standard deviation that it "
            "expects. 95 % should lie between the dashed lines, without a pattern, and their rms should be 1."
        )
    sheet.hint(
        "Below them a line for each channel says whether "
        f"{'the residual of the free run above' if fits else 'its innovation'} is noise; open it to see "
        "its autocorrelation (noise stays in the band), its histogram (noise follows the dashed curve)"
        f"{' and the rms of the innovations, stretch by stretch (95 % in the band)' if found else ''}."
    )
    for log in dict.fromkeys([*(fit.log for fit in fits), *(one.name for one in found)]):
        one = next((s for s in found if s.name == log), None)
        own = [fit for fit in fits if fit.log == log]
        sheet.part(log, badge="predicted only" if own and not own[0].identified_on else "")
        if one is not None:
            sheet.figures(_innovations(one))
        signals = dict.fromkeys([*(fit.signal for fit in own), *(one.innovation if one else ())])
        for signal in signals:
            _channel(sheet, log, signal, one, next((fit for fit in own if fit.signal == signal), None))


def _innovations(one: "States") -> Iterable[Row]:
    for name in one.innovation:
        size, out = innovation_size(one, name)
        note = f"rms {size:.2f}, {percent(out)} not used" if size == size else "never used"
        yield path(name), escape(note), figures.innovation(one, name, f"log {one.name}")


def _channel(sheet: Sheet, log: str, signal: str, one: "States | None", fit: "Fit | None") -> None:
    """A sentence, and the small figures behind it."""
    seen = one is not None and signal in one.innovation
    used = np.where(facts.rejected(one, signal), np.nan, facts.normalised(one, signal)) if one and seen else None
    if fit is not None:
        time, values, kind = fit.time, fit.measured - fit.predicted, "residual"
    else:
        assert one is not None
        assert used is not None
        time, values, kind = one.time, used, "innovation"
    values = np.where(np.isfinite(values), values, np.nan)
    values = values / max(float(np.nanmax(np.abs(values), initial=0.0)), 1e-300)  # one that ran away has no square
    found, far = whiteness.correlation(time, values), whiteness.beyond(values)
    told = f"{kind.capitalize()} {whiteness.in_words(found, far, free_run=fit is not None)}"
    rows: list[Row] = []
    name = (log, "consistency", signal)
    if found is not None:
        rows.append((f"Autocorrelation of the {kind}", "", checks.autocorrelation(found, name)))
        rows.append((f"Histogram of the {kind}", "", checks.histogram(values, name)))
    if one is not None and used is not None:
        size, _ = innovation_size(one, signal)
        told += f" {whiteness.size_in_words(size, int(np.isfinite(used).sum())).capitalize()}"
        parts = whiteness.stretches(one.time, used)
        if parts is not None:
            note = f"{percent(parts.inside)} of the stretches as expected"
            rows.append(("Rms of the innovation", escape(note), checks.sizes(parts, f"log {log}", name)))
    summary = f"{path(signal)}: <span>{escape(told)}</span>"
    if not rows:
        sheet.html(f'<p class="hint">{summary}</p>')
        return
    with sheet.folded(summary):
        sheet.figures(rows, kind="plots three")
