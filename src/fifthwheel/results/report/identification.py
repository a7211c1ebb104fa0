"""The report of an identification, and its document for a terminal."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from fifthwheel.base import pages
from fifthwheel.base.arguments import expect, expect_each
from fifthwheel.base.formatting import approximate, percent, shown, shown_parts, with_sigma
from fifthwheel.base.names import ParameterPath
from fifthwheel.base.pages import html
from fifthwheel.base.pages.html import cell, prose, text
from fifthwheel.base.plots import Axis, Panel, Plot
from fifthwheel.data.channels import SensorErrorName, si_unit
from fifthwheel.data.record import Record
from fifthwheel.estimate.design.assess import InformationAssessment
from fifthwheel.estimate.identify import Fit, Identification, Verdict
from fifthwheel.estimate.identify.estimates import sensor_error_unit
from fifthwheel.estimate.identify.result import display
from fifthwheel.estimate.identify.statement import prior_of, stated
from fifthwheel.estimate.identify.unknowns.parameters import softening_priors
from fifthwheel.estimate.observe import States
from fifthwheel.results.assess import Assessment
from fifthwheel.results.diagnose.cautions import is_unusual
from fifthwheel.results.diagnose.information_summary import ParameterInformation, information_summary
from fifthwheel.results.diagnose.residuals import fit_quality
from fifthwheel.results.diagnose.summaries import summarise_runs
from fifthwheel.results.report import assessment, front_page
from fifthwheel.results.report.conclusion import Conclusion, conclude_identification, counted
from fifthwheel.results.report.provenance import Provenance, logs_and_origin
from fifthwheel.results.report.states import StateConditions, all_states, consistency_section, states_section
from fifthwheel.truck import Vehicle, unit_of
from fifthwheel.truck.quantities import MASS_SCALE, TIME_BASE
from fifthwheel.truck.spoken_names import spoken
from fifthwheel.truck.uncertainty import changes

DRAWN = 3
"""Logs whose measurements and states are drawn before the appendix."""
DRAWN_CHANNELS = 16
"""Of these logs together."""
UNCERTAIN = ("Parameter|name", "Value>|main", "± sigma>|main|± ", "Unit|w main", "Prior>|full", "Remains>")


def write_report(
    path: str | Path,
    identification: Identification,
    records: Sequence[Record],
    states: Sequence[States] = (),
    *,
    title: str,
    name: str = "",
    conclusion: Conclusion | None = None,
    outlook: InformationAssessment | None = None,
    performance: Assessment | None = None,
    conditions: StateConditions | None = None,
    provenance: Provenance | None = None,
    figures: str | None = None,
) -> list[Path]:
    """Write the report of an identification as one HTML file.

    Args:
        records: the logs, including those that were only predicted; states and fits belong to them by name.
        states: of any of the records.
        title: usually the name of the vehicle.
        name: of the result, behind the title.
        conclusion: by default it is drawn from the other arguments.
        outlook: information at the identified vehicle, for predicted improvements.
        performance: what the identified truck does.
        conditions: how the states were estimated.
        provenance: command, files and versions, to reproduce the result.
        figures: "svg", "png" or "pdf" to write every figure into the folder "figures" beside the page too.

    Returns:
        The figures that were written.

    Raises:
        FifthwheelError: the format of the figures is unknown, or matplotlib is not installed.

    Example:
        >>> import fifthwheel as fw
        >>> result = fw.Identification.load("result")  # doctest: +SKIP
        >>> fw.write_report("report.html", result, [record], title="truck")  # doctest: +SKIP
    """
    expect("identification", identification, Identification)
    expect_each("records", records, Record)
    method = f"{identification.method} method, preset {identification.settings.preset}"
    unit = "iteration" if identification.method == "one-stage" else "round"
    runs = summarise_runs(identification, records)
    conclusion = conclusion or conclude_identification(identification, records, outlook, states)
    settings = (
        pages.Hint(f"Estimated in {counted(identification.rounds, unit)}. Model: {identification.model}."),
        pages.Values(identification.settings.as_dict()),
    )
    fits, first = _fits_by_log(identification), _first_logs(identification)
    others = {log: fits[log] for log in fits if log not in first}
    title_of_others = f"Measured and predicted, {counted(len(others), 'more log')}"
    more_fits = [pages.Folded(title_of_others, [_fit_figures(others)])] if others else []
    blocks: list[pages.Block] = [
        conclusion.box([front_page.main_numbers(identification, performance)]),
        *front_page.truck_and_runs(identification, records, runs),
        *front_page.estimates(identification),
        *_fits({log: fits[log] for log in fits if log in first}),
        *(states_section([s for s in states if s.name in first], records, conditions, identified=True)),
    ]
    appendix = [
        *pages.folded(assessment.section(performance) if performance is not None else ()),
        *more_fits,
        *pages.folded(_information(identification, outlook)),
        *pages.folded(_sensors(identification)),
        *_uncertain_numbers(identification),
        *assumed_numbers(identification.initial_vehicle),
        *pages.folded(_histories(identification)),
        *pages.folded(_residuals(identification)),
        *pages.folded(all_states(states, records)),
        *pages.folded(consistency_section(states, identification.fits)),
        *pages.folded(logs_and_origin(records, runs, provenance, identification)),
        pages.Folded("Settings", settings),
        *([pages.Folded("Notes", [pages.Items(conclusion.notes)])] if conclusion.notes else []),
    ]
    subtitle = f"Identification: {method}, fifthwheel {identification.version}"
    if provenance is not None:
        subtitle = "\n".join(filter(None, (provenance.note, ". ".join(filter(None, (provenance.time, subtitle))))))
    return html.write(Path(path), pages.Document(title, blocks, subtitle, appendix, name), images=figures)


def _first_logs(identification: Identification) -> set[str]:
    """The logs that are drawn before the appendix: up to three, of which one is a validation log where there is one,
    and fewer where they have many channels."""
    own, fits = [log.name for log in identification.logs], _fits_by_log(identification)
    others = [log for log in fits if log not in own]
    channels = max(map(len, fits.values()), default=1)
    return set([*others[:1], *own, *others[1:]][: min(DRAWN, max(DRAWN_CHANNELS // channels, 1))])


def identification_document(identification: Identification, conclusion: Conclusion | None = None) -> pages.Document:
    """Parameters with sigma and verdict, derived quantities, the fit, cautions and next steps.

    Without a conclusion, that of the identification without its logs and states.
    """
    conclusion = conclusion or conclude_identification(identification)
    blocks: list[pages.Block] = [
        pages.Headline(conclusion.headline, conclusion.good),
        display.estimates_table((*identification.parameters, *identification.stated_numbers), identification.derived),
        *_fit_tables(identification),
        *conclusion.advice(),
    ]
    return pages.Document(identification.vehicle.name, blocks)


def _sensors(identification: Identification) -> Iterator[pages.Block]:
    banks = [f"{log.name} {with_sigma(*log.bank, 'rad')}" for log in identification.logs if log.bank]
    if not identification.sensors and not banks:
        return
    yield pages.Heading("Sensor errors", key="sensors")
    if identification.sensors:
        yield pages.Hint(
            "Estimated together with the parameters. Measured value = gain × true value + offset; road-wheel angle = "
            "gain × (logged angle − offset)."
        )
        yield _sensor_errors(identification)
    if banks:
        yield pages.Hint(f"Bank angle of the road, positive with the left edge higher: {'; '.join(banks)}.")


def _uncertain_numbers(identification: Identification) -> Iterator[pages.Folded]:
    """What the logs added to each uncertain number of the vehicle file, of the tyres and of the model."""
    if not identification.uncertain:
        return
    explanation = pages.Hint(
        "These numbers are not exact. They are estimated together with the parameters, from their priors, and every "
        "sigma above includes their uncertainty. The last column is the fraction of the prior sigma that remains: at "
        "100 % the logs contain no information on the number. Some numbers change together: their row shows the "
        "number that changes most, and that of the scale of all masses the sum of the masses. “–”: a number of the "
        "model, of which the result has no value."
    )
    remaining, rows = dict(identification.remaining_uncertainty), list[tuple[pages.Cell, ...]]()
    listed = {e.name for e in identification.uncertain}
    for e in identification.uncertain:
        cells = _change(e.value, e.sigma, e.initial, e.prior, e.unit)
        left = remaining.pop(e.name, min((e.sigma or 0.0) / (e.prior or math.inf), 1.0))
        rows.append((pages.Hinted(spoken(e.name), e.name), *cells, percent(left)))
    together = {change.name: change.slopes for change in changes(identification.initial_vehicle)}
    before, after = identification.initial_vehicle.parameters(), identification.vehicle.parameters()
    for name, kept in remaining.items():
        slopes = {path: abs(slope) for path, slope in together.get(name, {}).items() if path in before}
        if name == MASS_SCALE and slopes:
            masses = [path for path in slopes if ParameterPath.of(path)[1:] == ("", "mass")]
            value, initial, prior = (sum(table[path] for path in masses) for table in (after, before, slopes))
            cells, hint = _change(value, kept * prior, initial, prior, "kg"), f"{name}: mass of all units"
        elif path := max(slopes, key=lambda path: slopes[path], default=None):
            if path in listed:
                continue
            cells = _change(after[path], kept * slopes[path], before[path], slopes[path], unit_of(path))
            hint = name if path == name else f"{name}: {path}"
        else:
            mean, prior, unit = _prior_alone(identification, name)
            cells, hint = ("–", *_change(mean, kept * prior, mean, prior, unit)[1:]), name
        rows.append((pages.Hinted(spoken(name), hint), *cells, percent(kept)))
    yield pages.Folded(f"Uncertain numbers ({len(rows)})", (explanation, pages.Table(UNCERTAIN, rows)))


def _prior_alone(identification: Identification, name: str) -> tuple[float, float, str]:
    """Prior mean and standard deviation, and SI unit, of an uncertain number that no vehicle file has."""
    vehicle, given = identification.initial_vehicle, identification.settings.given
    if SensorErrorName.of(name):
        return *identification.prior_of_sensor_error(name), sensor_error_unit(name)
    path = ParameterPath.of(name)
    if path.quantity == "softening":
        mean, sigma = softening_priors(vehicle)[path.owner]
        found = stated(given, name, "1/rad", mean)
        return found.value, found.or_sigma(sigma), "1/rad"
    mean, sigma = prior_of(given, name)
    return (1.0 if name == TIME_BASE else mean), vehicle.stated.get(name, sigma), "1"


def _change(value: float, sigma: float | None, initial: float, prior: float | None, unit: str) -> tuple[str, ...]:
    text, spread, name = shown_parts(value, sigma, unit)
    before, prior_text, _ = shown_parts(initial, prior, unit)
    return text, spread or "–", name, before if prior_text is None else f"{before} ± {prior_text}"


def _sensor_errors(identification: Identification) -> pages.Table:
    rows = []
    for error in identification.sensors:
        signal, kind = SensorErrorName.of(error.name) or (error.name, "")
        rows.append(
            (
                pages.Code(signal),
                kind,
                error.log if error.log is not None else "all logs",
                with_sigma(error.value, error.sigma, error.unit),
                with_sigma(*identification.prior_of_sensor_error(error.name), error.unit),
                pages.Mark("! unusual", "plain", row="warn") if is_unusual(identification, error) else "",
            )
        )
    return pages.Table(("Signal|name", "Error|w", "Log", "Estimate>", "Prior>", "|w"), rows)


def assumed_numbers(vehicle: Vehicle) -> Iterator[pages.Folded]:
    """The numbers that a vehicle file does not have, with their sources."""
    if not vehicle.assumed:
        return
    values = vehicle.parameters()
    explanation = pages.Hint(
        "The vehicle file does not have these numbers: they are typical, or those of the vehicle classes of its units. "
        "Measure those with a large part in the variance, and write them into the vehicle file."
    )
    rows = [
        (pages.Code(path), with_sigma(values[path], vehicle.stated.get(path), unit_of(path)), source)
        for path, source in vehicle.assumed.items()
    ]
    yield pages.Folded(
        f"Assumed numbers of the vehicle file ({len(rows)})",
        (explanation, pages.Table(("Parameter|name", "Value>|main", "Source|full"), rows)),
    )


def _information(identification: Identification, outlook: InformationAssessment | None) -> Iterator[pages.Block]:
    rows = information_summary(identification, outlook)
    if not rows:
        return
    yield pages.Heading("Information in the logs", key="information")
    yield pages.Hint(
        "The bar shows the fraction of the prior sigma that remains. A short bar: the logs contain much information on "
        "the parameter. A full bar: they contain none."
    )
    if any(row.improvements for row in rows):
        yield pages.Hint(
            "Predictions are lower limits: they include sensor noise and the uncertain parameters, but no model error."
        )
    if any(row.noise_sigma for row in rows):
        yield pages.Hint(
            "Autocorrelated residuals indicate a model error; sigma includes their effect. Repeating the same "
            "run does then not help much. Drive another manoeuvre, or correct the vehicle file."
        )
    yield pages.Markup("\n".join(map(_bar, rows)))


def _bar(row: ParameterInformation) -> str:
    """A bar of the prior sigma that remains, and what limits sigma."""
    remaining = 1.0 if row.remaining is None else row.remaining
    css_class = "" if row.estimate.verdict is Verdict.CONVERGED else ' class="prior"'
    bar = f'<span class="bar" aria-hidden="true"><i{css_class} style="width:{100 * remaining:.1f}%"></i></span>'
    note = "" if row.remaining is None else f"<small>{percent(remaining)} of the prior sigma remains</small>"
    messages = "".join(f"<li>{prose(message)}</li>" for message in row.messages)
    name = f"{cell(pages.Hinted(spoken(row.estimate.name), row.estimate.name))}{bar}<b>{text(row.change)}</b>{note}"
    return f'<div class="information"><div>{name}</div><ul>{messages}</ul></div>'


def _histories(identification: Identification) -> Iterator[pages.Block]:
    yield pages.Heading("Histories of the estimates", key="histories")
    one_stage = identification.method == "one-stage"
    if one_stage:
        yield pages.Hint(
            "Each point is the estimate from all data up to that time; all unknowns are estimated together. The band "
            "is one sigma; at the end it is that of the table, with model error and uncertain numbers. Before it, what "
            "these add to the filter's variance is interpolated."
        )
    else:
        rounds = " All rounds are shown; in the first, stage 1 has no roll, which biases its estimates."
        yield pages.Hint(
            "The estimate while the filter passes through the logs several times; grey vertical lines separate the "
            "passes. A pass starts at the last estimate with the prior sigma; its last step restores the prior mean. "
            "The band is one sigma; at the end it is that of the table, with the autocorrelation of the residuals. "
            "Before it, what this adds to the filter's variance is interpolated."
            f"{rounds if identification.rounds > 1 else ''}"
        )
    for title, history in identification.histories.items():
        passes = f"{history.passes} pass{'es' * (history.passes > 1)}"
        yield pages.Heading(title.capitalize() if one_stage else f"{title.capitalize()}: {passes}")
        figures = [
            pages.CaptionedPlot(
                spoken(e.name),
                Plot(panels=[display.history_panel(history, e)]),
                group=f"history {title}",
                path=("parameters", "history", e.name),
                note=f"final {with_sigma(e.value, e.sigma, e.unit)}",
            )
            for e in identification.parameters
            if e.name in history.names
        ]
        yield (
            pages.Plots(figures)
            if figures
            else pages.Hint("No parameter of this stage was excited enough to be estimated.")
        )
    drawn = {name for history in identification.histories.values() for name in history.names}
    without = [spoken(e.name) for e in identification.parameters if e.name not in drawn]
    if without and len(without) < len(identification.parameters):
        yield pages.Hint(f"Not estimated, therefore without a history: {'; '.join(without)}.")


def _fits(logs: Mapping[str, Sequence[Fit]]) -> Iterator[pages.Block]:
    if not logs:
        return
    yield pages.Heading("Measured and predicted", key="fits")
    yield pages.Hint(
        "The model of the identified truck predicts each measurement from speed and steer angle alone. Explained: the "
        "fraction of the variance of the measurement that this prediction explains; noise cannot be explained."
    )
    yield _fit_figures(logs)


def _fit_figures(logs: Mapping[str, Sequence[Fit]]) -> pages.Plots:
    return pages.Plots([_log_figure(log, fits, "fit", _fit_panel) for log, fits in logs.items()])


def _residuals(identification: Identification) -> Iterator[pages.Block]:
    yield pages.Heading("Residuals of the prediction", key="residuals")
    yield pages.Hint(
        "The prediction is the output of the free-running model: no measurement corrects it. A slow wave in the "
        "residual indicates a model error. Of each log only the sensor offsets are fitted, and of each segment the "
        "bank of the road and the state at its start, about the steady state of its first steer angle: to all samples, "
        "within their priors."
    )
    yield from _fit_tables(identification)
    logs = _fits_by_log(identification).items()
    yield pages.Plots([_log_figure(log, fits, "residual", _residual_panel) for log, fits in logs])


def _log_figure(log: str, fits: Sequence[Fit], section: str, panel: Callable[[Fit], Panel]) -> pages.CaptionedPlot:
    badge = "" if fits[0].identified_on else "validation log"
    plot = Plot(panels=list(map(panel, fits)))
    return pages.CaptionedPlot(log, plot, f"log {log}", (log, section, "all channels"), text=badge)


def _fit_panel(fit: Fit) -> Panel:
    return display.fit_panel(fit, title=f"{spoken(fit.signal)}: {_explained(fit)} explained")


def _residual_panel(fit: Fit) -> Panel:
    unit = si_unit(fit.signal)
    title = f"{spoken(fit.signal)}: {approximate(fit.rms, unit)} rms"
    return replace(display.residual_panel(fit), title=title, y=Axis(unit=shown(unit).name))


def _fits_by_log(identification: Identification) -> dict[str, list[Fit]]:
    logs: dict[str, list[Fit]] = {}
    for fit in identification.fits:
        logs.setdefault(fit.log, []).append(fit)
    return logs


def _fit_tables(identification: Identification) -> Iterator[pages.Table]:
    for log, fits in _fits_by_log(identification).items():
        rows = []
        for fit in fits:
            unit, noise = si_unit(fit.signal), fit_quality(fit, identification.settings.stated_noise).noise
            shown_noise = approximate(noise, unit) if np.isfinite(noise) else "–"
            rows.append((fit.signal, _explained(fit), approximate(fit.rms, unit), shown_noise))
        head = log if fits[0].identified_on else f"{log} (validation log)"
        yield pages.Table((pages.TableColumn(head), "Explained>", "Residual rms>", "Noise>"), rows)


def _explained(fit: Fit) -> str:
    return percent(max(fit.explained, 0.0), round_down=True)
