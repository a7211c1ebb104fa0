"""The sections of a report."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING

import numpy as np

from fifthwheel.channels import is_sensor_error
from fifthwheel.diagnose import whiteness
from fifthwheel.diagnose.fit_quality import FitQuality, fit_quality
from fifthwheel.diagnose.information_summary import information_summary
from fifthwheel.diagnose.state_summary import (
    innovation_size,
    normalised_innovation,
    record_of,
    rejected_samples,
    summarise_states,
)
from fifthwheel.diagnose.thresholds import WIDE_SIGMA
from fifthwheel.formatting import approximate, percent, with_sigma
from fifthwheel.identify import Fit, Identification
from fifthwheel.names import split_log
from fifthwheel.observe import States
from fifthwheel.record import Record
from fifthwheel.record.signal_names import si_unit
from fifthwheel.report.figures import residuals, time_series
from fifthwheel.report.html import tables
from fifthwheel.report.html.page_builder import CaptionedPlot, PageBuilder
from fifthwheel.report.html.tables import code
from fifthwheel.report.text.words import WIDE_MARK, counted

if TYPE_CHECKING:
    from fifthwheel.identify.design.assess import InformationAssessment


@dataclass(frozen=True, kw_only=True)
class StateConditions:
    """How states were estimated."""

    smoothed: bool = False
    uncertain: tuple[str, ...] = ()  # vehicle parameters and sensor errors whose uncertainty every sigma includes

    def in_words(self, *, identified: bool = False) -> str:
        """What the bands include; `identified` for states in the report of an identification."""
        errors = len({split_log(name)[0] for name in self.uncertain if is_sensor_error(name)})
        parameters = sum(not is_sensor_error(name) for name in self.uncertain)
        if self.uncertain:
            counts = f"{counted(parameters, 'vehicle parameter')} and {counted(errors, 'sensor error')}"
            text = f"The band includes the uncertainty of {counts} from the identification."
        elif identified:
            text = (
                "The band does not include the uncertainty of the parameters and sensor errors. Only the one-stage "
                "method "
                "estimates this uncertainty."
            )
        else:
            text = (
                "The band does not include the uncertainty of the parameters and sensor errors. To include it, give "
                "identification.json (-i)."
            )
        return f"{text} Smoothed: each sample also uses later measurements." if self.smoothed else text


def parameters(page: PageBuilder, identification: Identification) -> None:
    """Estimates, derived quantities, sensor errors and uncertain parameters."""
    page.heading("parameters", "Parameters")
    last = "" if identification.method == "one-stage" else " in the last pass"
    page.hint(
        "Sigma is one standard deviation of the result, from the logs and the prior; the prior is what was assumed "
        "before the logs were used. A grey row is not an estimate: it shows the value of the vehicle file, or the "
        f"initial value. {WIDE_MARK} marks a sigma above {percent(WIDE_SIGMA)} of the value. “Settled after”: the "
        f"driving time{last} after which the estimate stays within {percent(identification.settings.tolerance)} of its "
        "later average. “–”: it did not settle."
    )
    page.html(tables.estimates(identification.parameters))
    if identification.derived:
        page.subheading("Derived from the payload")
        page.hint(
            "Height of the CoG of the laden sprung mass above the ground, and roll inertia of this mass about the roll "
            "axis."
        )
        page.html(tables.estimates(identification.derived, history=False))
    if identification.sensors:
        page.subheading("Sensor errors")
        page.hint(
            "Estimated together with the parameters. Measured value = gain × true value + offset; road-wheel angle = "
            "gain × (logged angle − offset)."
        )
        page.html(tables.sensor_errors(identification))
    banks = [f"{log.name} {with_sigma(*log.bank, 'rad')}" for log in identification.logs if log.bank]
    if banks:
        page.hint(f"Bank angle of the road, positive with the left edge higher: {'; '.join(banks)}.")
    if identification.uncertain:
        with page.folded(f"Uncertain parameters of the vehicle file ({len(identification.uncertain)})"):
            page.hint(
                "The values of the vehicle file are not exact. A considered parameter (Schmidt) keeps its value; its "
                "uncertainty is included in every sigma above. The others are estimated together with the parameters, "
                "from their priors."
            )
            page.html(tables.estimates(identification.uncertain, history=False))
    vehicle = identification.initial_vehicle
    if vehicle.assumed:
        with page.folded(f"Assumed numbers of the vehicle file ({len(vehicle.assumed)})"):
            page.hint(
                "The vehicle file does not have these numbers: they are those of the vehicle classes of its units. "
                "Measure those with a large part in the variance, and write them into the vehicle file."
            )
            page.html(tables.assumed(vehicle))


def information(page: PageBuilder, identification: Identification, outlook: "InformationAssessment | None") -> None:
    """How much information the logs contain on each parameter."""
    rows = information_summary(identification, outlook)
    if not rows:
        return
    page.heading("information", "Information in the logs")
    page.hint(
        "The bar shows the fraction of the prior sigma that remains. A short bar: the logs contain much information on "
        "the parameter. A full bar: they contain none."
    )
    if any(row.improvements for row in rows):
        page.hint(
            "Predictions are lower limits: they include sensor noise and the uncertain parameters, but no model error."
        )
    if any(row.noise_sigma for row in rows):
        page.hint(
            "Autocorrelated residuals indicate a model error; sigma includes their effect. Repeating the same "
            "run does then not help much. Drive another manoeuvre, or correct the vehicle file."
        )
    page.html(tables.information(rows))


def histories(page: PageBuilder, identification: Identification) -> None:
    """The history of each estimate over driving time."""
    page.heading("histories", "Histories of the estimates")
    one_stage = identification.method == "one-stage"
    if one_stage:
        page.hint(
            "Each point is the estimate from all data up to that time; all unknowns are estimated together. The band "
            "is one sigma at that time, for an exact model. The error bar at the right is the sigma of the table; it "
            "also includes the autocorrelation of the residuals and the uncertain parameters of the vehicle file."
        )
    else:
        rounds = " All rounds are shown; in the first, stage 1 has no roll, which biases its estimates."
        page.hint(
            "The estimate while the filter passes through the logs several times; grey vertical lines separate the "
            "passes. A pass starts at the last estimate with the prior sigma; its last step restores the prior mean. "
            "The band is one sigma of the filter. The error bar at the right is the sigma of the table, which also "
            f"includes the autocorrelation of the residuals.{rounds if identification.rounds > 1 else ''}"
        )
    for title, history in identification.histories.items():
        estimates = [e for e in identification.parameters if e.name in history.names]
        passes = f"{history.passes} pass{'es' * (history.passes > 1)}"
        page.subheading(title.capitalize() if one_stage else f"{title.capitalize()}: {passes}")
        if not estimates:
            page.hint("No parameter of this stage was excited enough to be estimated.")
            continue
        page.figures(
            CaptionedPlot(
                code(e.name),
                f"final {escape(with_sigma(e.value, e.sigma, e.unit))}",
                time_series.history(history, e, f"history {title}"),
            )
            for e in estimates
        )
    shown = {name for history in identification.histories.values() for name in history.names}
    without = [e.name for e in identification.parameters if e.name not in shown]
    if without and len(without) < len(identification.parameters):
        page.hint(f"Not estimated, therefore without a history: {', '.join(without)}.")


def fits(page: PageBuilder, identification: Identification) -> None:
    """Each channel of each log as measured and as predicted."""
    page.heading("fits", "Measured and predicted")
    page.hint(
        "The prediction is the output of the free-running model of the identified truck: it uses speed and steer angle "
        "only, and no measurement corrects it. Explained is the fraction of the channel's variance that the "
        "prediction explains. Sensor noise "
        "cannot be explained. A slow wave in the residual indicates a model error. Of each log only the sensor "
        "offsets are fitted, and of each segment the bank of the road and the state at its start, about the steady "
        "state of its first steer angle: to all samples, within their priors."
    )
    for log in dict.fromkeys(fit.log for fit in identification.fits):
        fits = [fit for fit in identification.fits if fit.log == log]
        page.subheading(log, badge="" if fits[0].identified_on else "validation log")
        page.figures(_captioned_fit(fit, fit_quality(fit, identification.settings.noise)) for fit in fits)


def _captioned_fit(fit: Fit, quality: FitQuality) -> CaptionedPlot:
    unit = si_unit(fit.signal)
    caption = f"{code(fit.signal)}: {percent(max(fit.explained, 0.0), round_down=True)} explained"
    note = f"residual {approximate(fit.rms, unit)} rms"
    if np.isfinite(quality.noise):
        note += f", sensor noise about {approximate(quality.noise, unit)}"
        note += "; no more can be explained" if quality.noise_limited else ""
    return CaptionedPlot(caption, escape(note), time_series.fit(fit, f"log {fit.log}"))


def states(
    page: PageBuilder,
    states: Sequence[States],
    records: Sequence[Record],
    conditions: StateConditions | None,
    *,
    reliable: bool = True,
    identified: bool = False,
) -> None:
    """Each state of each log with its band, its measurement and its reference."""
    page.heading("states", "States")
    band = f" {conditions.in_words(identified=identified)}" if conditions else ""
    doubt = "" if reliable else " Do not rely on these states: the truck does not fit the measurements (see the top)."
    page.hint(
        f"The lines are the estimated states; the band is ± 2 sigma (95 %).{band} Measured values are not corrected "
        "for "
        f"offsets. Do not use the states in shaded intervals.{doubt}"
    )
    for s in states:
        record, summary = record_of(s, records), summarise_states(s, records)
        page.subheading(s.name)
        page.html(tables.statuses(summary.status, time_series.STATUS_COLOURS))
        plots = []
        for name in s.values:
            unit, width, rms = si_unit(name), summary.band[name], summary.reference_rms[name]
            note = "never estimated" if width is None else f"± {approximate(width, unit)} (2 sigma, median)"
            note += "" if rms is None else f"; rms difference from the reference {approximate(rms, unit)}"
            plot = time_series.state(s, record, name, f"log {s.name}")
            plots.append(CaptionedPlot(code(name), escape(note), plot))
        page.figures(plots)


def consistency(page: PageBuilder, states: Sequence[States], fits: Sequence[Fit]) -> None:
    """Whether the innovations of the states and the residuals of the identification are white noise."""
    page.heading("consistency", "Residuals and consistency")
    if states:
        page.hint(
            "The normalised innovation is the measurement minus the prediction of the state filter, divided by its "
            "predicted standard deviation. 95 % of the normalised innovations should lie between the dashed lines, "
            "without a pattern; their rms should be 1."
        )
    page.hint(
        f"Below, one line per channel says whether its {'residual' if fits else 'normalised innovation'} is white "
        "noise. "
        "Click a line to see the plots: autocorrelation (white noise stays inside the band), histogram (normal noise "
        "follows the dashed curve)"
        f"{', rms of the normalised innovations in time windows (95 % should lie inside the band)' if states else ''}."
    )
    for log in dict.fromkeys([*(fit.log for fit in fits), *(s.name for s in states)]):
        log_states = next((s for s in states if s.name == log), None)
        log_fits = {fit.signal: fit for fit in fits if fit.log == log}
        predicted_only = any(not fit.identified_on for fit in log_fits.values())
        page.subheading(log, badge="validation log" if predicted_only else "")
        if log_states is not None:
            page.figures(_innovations(log_states))
        for signal in dict.fromkeys([*log_fits, *(log_states.innovation if log_states else ())]):
            _channel(page, log, signal, log_states, log_fits.get(signal))


def _innovations(states: States) -> Iterator[CaptionedPlot]:
    for name in states.innovation:
        size = innovation_size(states, name)
        note = f"rms {size.rms:.2f}, {percent(size.rejected)} rejected" if np.isfinite(size.rms) else "never used"
        yield CaptionedPlot(code(name), escape(note), time_series.innovation(states, name, f"log {states.name}"))


def _channel(page: PageBuilder, log: str, signal: str, states: States | None, fit: Fit | None) -> None:
    """What the residual or the innovation of a channel means, with its small figures folded away."""
    accepted = None
    if states is not None and signal in states.innovation:
        accepted = np.where(rejected_samples(states, signal), np.nan, normalised_innovation(states, signal))
    if fit is not None:
        kind, time, values = "residual", fit.time, fit.measured - fit.predicted
    else:
        assert states is not None
        assert accepted is not None
        kind, time, values = "innovation", states.time, accepted
    values = np.where(np.isfinite(values), values, np.nan)
    values = values / max(float(np.nanmax(np.abs(values), initial=0.0)), 1e-300)  # squares stay finite
    correlation = whiteness.autocorrelation(time, values)
    outliers, in_sigma = whiteness.outlier_fraction(values), fit is not None and fit.identified_on
    text = whiteness.describe_whiteness(correlation, outliers, free_run=fit is not None, in_sigma=in_sigma)
    name = (log, "consistency", signal)
    plots = []
    if correlation is not None:
        plots.append(CaptionedPlot(f"Autocorrelation of the {kind}", "", residuals.autocorrelation(correlation, name)))
        plots.append(CaptionedPlot(f"Histogram of the {kind}", "", residuals.histogram(values, name)))
    if states is not None and accepted is not None:
        size = innovation_size(states, signal)
        text += f" {whiteness.describe_innovation_rms(size.rms, int(np.isfinite(accepted).sum()))}"
        segments = whiteness.segment_rms(states.time, accepted)
        if segments is not None:
            note = f"{percent(segments.fraction_within_limits)} of the time windows inside the band"
            plot = residuals.rms_by_segment(segments, f"log {log}", name)
            plots.append(CaptionedPlot("Rms of the innovation", note, plot))
    summary = f"{code(signal)}: <span>{escape(text)}</span>"
    if not plots:
        page.html(f'<p class="hint">{summary}</p>')
        return
    with page.folded(summary):
        page.figures(plots, css_class="plots three")
