"""The report of an identification, and its result on a terminal."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from fifthwheel import pages
from fifthwheel.assess import Assessment
from fifthwheel.channels import SensorErrorName, si_unit
from fifthwheel.diagnose.cautions import is_unusual, sensor_error_prior
from fifthwheel.diagnose.fit_quality import FitQuality, fit_quality
from fifthwheel.diagnose.information_summary import ParameterInformation, information_summary
from fifthwheel.diagnose.summaries import summarise_runs
from fifthwheel.diagnose.thresholds import WIDE_SIGMA
from fifthwheel.formatting import approximate, percent, relative, seconds, shown, value_and_sigma, with_sigma
from fifthwheel.identify import Estimate, Fit, Identification, Verdict
from fifthwheel.identify.design.assess import InformationAssessment
from fifthwheel.identify.result import display
from fifthwheel.observe import States
from fifthwheel.pages import page, terminal
from fifthwheel.pages.html import cell, prose, text
from fifthwheel.plots import Plot
from fifthwheel.record import Record
from fifthwheel.report import assessment, consistency
from fifthwheel.report.conclusion import Conclusion, conclude_identification
from fifthwheel.report.provenance import Provenance, logs_and_origin
from fifthwheel.report.states import StateConditions, states_section
from fifthwheel.report.words import WIDE_MARK, counted, mark, spoken_verdict
from fifthwheel.vehicle import Vehicle, unit_of

ESTIMATES = (
    *("Parameter|name", "Verdict|full", "Value>|main", "± sigma>|main|± ", "Unit|w main", "Relative>", "Prior>|full"),
    "Settled after>",
)
UNCERTAIN = ("Parameter|name", "Value>|main", "± sigma>|main|± ", "Unit|w main", "Prior>|full", "Remains>")


def write_report(
    path: str | Path,
    identification: Identification,
    records: Sequence[Record],
    states: Sequence[States] = (),
    *,
    title: str,
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
    method = f"{identification.method} method, preset {identification.settings.preset}"
    unit = "iteration" if identification.method == "one-stage" else "round"
    settings = (
        pages.Hint(f"Estimated in {counted(identification.rounds, unit)}."),
        pages.Values(identification.settings.as_dict()),
    )
    blocks: list[pages.Block] = [
        (conclusion or conclude_identification(identification, records, outlook, states)).box(),
        *_parameters(identification),
        *_information(identification, outlook),
        *_histories(identification),
        *_fits(identification),
        *(states_section(states, records, conditions, identified=True) if states else ()),
        *consistency.section(states, identification.fits),
        *(assessment.section(performance) if performance is not None else ()),
        pages.Heading("Logs and settings", key="logs"),
        *logs_and_origin(records, summarise_runs(identification, records), provenance, identification),
        pages.Folded("Settings", settings),
    ]
    subtitle = f"Identification: {method}, fifthwheel {identification.version}"
    return page.write(Path(path), pages.Document(title, blocks, subtitle), images=figures)


def show_identification(
    identification: Identification, console: "terminal.Console | None" = None, conclusion: Conclusion | None = None
) -> None:
    """Print an identification; the conclusion as of `identification_document`."""
    terminal.show(identification_document(identification, conclusion), console)


def identification_document(identification: Identification, conclusion: Conclusion | None = None) -> pages.Document:
    """Parameters with sigma and verdict, derived quantities, the fit, cautions and next steps.

    Without a conclusion, that of the identification without its logs and states.
    """
    conclusion = conclusion or conclude_identification(identification)
    blocks: list[pages.Block] = [
        pages.Headline(conclusion.headline, conclusion.good),
        display.estimates_table((*identification.parameters, *identification.derived)),
        *_fit_tables(identification),
        *conclusion.advice(),
    ]
    return pages.Document(identification.vehicle.name, blocks)


def _parameters(identification: Identification) -> Iterator[pages.Block]:
    yield pages.Heading("Parameters", key="parameters")
    last = "" if identification.method == "one-stage" else " in the last pass"
    yield pages.Hint(
        "Sigma is one standard deviation of the result, from the logs and the prior; the prior is what was assumed "
        "before the logs were used. A grey row is not determined by the logs: its value comes mostly from the prior or "
        f"the vehicle file. {WIDE_MARK} marks a sigma above {percent(WIDE_SIGMA)} of the value. “Settled after”: the "
        f"driving time{last} after which the estimate stays within {percent(identification.settings.tolerance)} of its "
        "later average. “–”: it did not settle."
    )
    yield _estimates(identification.parameters, history=True)
    if identification.derived:
        yield pages.Heading("Derived from the payload")
        yield pages.Hint(
            "Height of the CoG of the laden sprung mass above the ground, and roll inertia of this mass about the roll "
            "axis."
        )
        yield _estimates(identification.derived)
    if identification.sensors:
        yield pages.Heading("Sensor errors")
        yield pages.Hint(
            "Estimated together with the parameters. Measured value = gain × true value + offset; road-wheel angle = "
            "gain × (logged angle − offset)."
        )
        yield _sensor_errors(identification)
    banks = [f"{log.name} {with_sigma(*log.bank, 'rad')}" for log in identification.logs if log.bank]
    if banks:
        yield pages.Hint(f"Bank angle of the road, positive with the left edge higher: {'; '.join(banks)}.")
    if identification.uncertain:
        yield _uncertain_numbers(identification)
    if identification.initial_vehicle.assumed:
        yield assumed_numbers(identification.initial_vehicle)


def _estimates(estimates: Sequence[Estimate], *, history: bool = False) -> pages.Table:
    """Estimates with verdict, sigma and prior; with `history` also when they settled."""
    rows: list[tuple[pages.Cell, ...]] = []
    for e in estimates:
        unit = shown(e.unit)
        value, sigma = value_and_sigma(e.value * unit.factor, None if e.sigma is None else e.sigma * unit.factor)
        prior, spread = value_and_sigma(e.initial * unit.factor, None if e.prior is None else e.prior * unit.factor)
        rows.append(
            (
                pages.Code(e.name),
                pages.Mark(
                    spoken_verdict(e.verdict), e.verdict, mark(e), "" if e.verdict is Verdict.CONVERGED else "off"
                ),
                value,
                sigma or "–",
                unit.name,
                relative(e.value, e.sigma),
                prior if spread is None else f"{prior} ± {spread}",
                *([seconds(e.settling_time)] if history else []),
            )
        )
    return pages.Table(ESTIMATES if history else ESTIMATES[:-1], rows)


def _uncertain_numbers(identification: Identification) -> pages.Folded:
    """What the logs added to each uncertain number of the vehicle file, of the tyres and of the model."""
    explanation = pages.Hint(
        "These numbers are not exact. They are estimated together with the parameters, from their priors, and every "
        "sigma above includes their uncertainty. The last column is the fraction of the prior sigma that remains: at "
        "100 % the logs contain no information on the number. A row without a value is a group of numbers that change "
        "together, such as all masses with the scale that weighed them."
    )
    remaining, rows = dict(identification.remaining_uncertainty), list[tuple[pages.Cell, ...]]()
    for e in identification.uncertain:
        unit = shown(e.unit)
        value, sigma = value_and_sigma(e.value * unit.factor, None if e.sigma is None else e.sigma * unit.factor)
        prior, spread = value_and_sigma(e.initial * unit.factor, None if e.prior is None else e.prior * unit.factor)
        left = remaining.pop(e.name, None)
        rows.append(
            (
                pages.Code(e.name),
                value,
                sigma or "–",
                unit.name,
                prior if spread is None else f"{prior} ± {spread}",
                "–" if left is None else percent(left),
            )
        )
    rows += [(pages.Code(name), "–", "–", "", "–", percent(left)) for name, left in remaining.items()]
    return pages.Folded(f"Uncertain numbers ({len(rows)})", (explanation, pages.Table(UNCERTAIN, rows)))


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
                with_sigma(*sensor_error_prior(identification, error.name), error.unit),
                pages.Mark("! unusual", "plain", row="warn") if is_unusual(identification, error) else "",
            )
        )
    return pages.Table(("Signal|name", "Error|w", "Log", "Estimate>", "Prior>", "|w"), rows)


def assumed_numbers(vehicle: Vehicle) -> pages.Folded:
    """The numbers that a vehicle file leaves to vehicle classes, with their sources."""
    values = vehicle.parameters()
    explanation = pages.Hint(
        "The vehicle file does not have these numbers: they are those of the vehicle classes of its units. Measure "
        "those with a large part in the variance, and write them into the vehicle file."
    )
    rows = [
        (pages.Code(path), with_sigma(values[path], vehicle.stated.get(path), unit_of(path)), source)
        for path, source in vehicle.assumed.items()
    ]
    return pages.Folded(
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
    name = f"{cell(pages.Code(row.estimate.name))}{bar}<b>{text(row.change)}</b>{note}"
    return f'<div class="information"><div>{name}</div><ul>{messages}</ul></div>'


def _histories(identification: Identification) -> Iterator[pages.Block]:
    """The history of each estimate over driving time."""
    yield pages.Heading("Histories of the estimates", key="histories")
    one_stage = identification.method == "one-stage"
    if one_stage:
        yield pages.Hint(
            "Each point is the estimate from all data up to that time; all unknowns are estimated together. The band "
            "is one sigma at that time, for an exact model. The error bar at the right is the sigma of the table; it "
            "also includes the autocorrelation of the residuals and the uncertain parameters of the vehicle file."
        )
    else:
        rounds = " All rounds are shown; in the first, stage 1 has no roll, which biases its estimates."
        yield pages.Hint(
            "The estimate while the filter passes through the logs several times; grey vertical lines separate the "
            "passes. A pass starts at the last estimate with the prior sigma; its last step restores the prior mean. "
            "The band is one sigma of the filter. The error bar at the right is the sigma of the table, which also "
            f"includes the autocorrelation of the residuals.{rounds if identification.rounds > 1 else ''}"
        )
    for title, history in identification.histories.items():
        passes = f"{history.passes} pass{'es' * (history.passes > 1)}"
        yield pages.Heading(title.capitalize() if one_stage else f"{title.capitalize()}: {passes}")
        figures = [
            pages.CaptionedPlot(
                pages.Code(e.name),
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
    without = [e.name for e in identification.parameters if e.name not in drawn]
    if without and len(without) < len(identification.parameters):
        yield pages.Hint(f"Not estimated, therefore without a history: {', '.join(without)}.")


def _fits(identification: Identification) -> Iterator[pages.Block]:
    yield pages.Heading("Measured and predicted", key="fits")
    yield pages.Hint(
        "The prediction is the output of the free-running model of the identified truck: it uses speed and steer angle "
        "only, and no measurement corrects it. Explained is the fraction of the channel's variance that the "
        "prediction explains. Sensor noise cannot be explained. A slow wave in the residual indicates a model "
        "error. Of each log only the sensor offsets are fitted, and of each segment the bank of the road and the "
        "state at its start, about the steady state of its first steer angle: to all samples, within their priors."
    )
    for log, fits in _fits_by_log(identification).items():
        yield pages.Heading(log, badge="" if fits[0].identified_on else "validation log")
        yield pages.Plots([_fit(fit, fit_quality(fit, identification.settings.noise)) for fit in fits])


def _fits_by_log(identification: Identification) -> dict[str, list[Fit]]:
    logs: dict[str, list[Fit]] = {}
    for fit in identification.fits:
        logs.setdefault(fit.log, []).append(fit)
    return logs


def _fit(fit: Fit, quality: FitQuality) -> pages.CaptionedPlot:
    unit = si_unit(fit.signal)
    note = f"residual {approximate(fit.rms, unit)} rms"
    if np.isfinite(quality.noise):
        note += f", sensor noise about {approximate(quality.noise, unit)}"
        note += "; no more can be explained" if quality.noise_limited else ""
    return pages.CaptionedPlot(
        pages.Code(fit.signal),
        Plot(panels=[display.fit_panel(fit), replace(display.residual_panel(fit), height=0.4)]),
        group=f"log {fit.log}",
        path=(fit.log, "fit", fit.signal),
        text=f"{_explained(fit)} explained",
        note=note,
    )


def _fit_tables(identification: Identification) -> Iterator[pages.Table]:
    """The fits of each log, for a terminal."""
    for log, fits in _fits_by_log(identification).items():
        rows = []
        for fit in fits:
            unit, noise = si_unit(fit.signal), fit_quality(fit, identification.settings.noise).noise
            shown_noise = approximate(noise, unit) if np.isfinite(noise) else "–"
            rows.append((fit.signal, _explained(fit), approximate(fit.rms, unit), shown_noise))
        head = log if fits[0].identified_on else f"{log} (validation log)"
        yield pages.Table((pages.TableColumn(head), "Explained>", "Residual rms>", "Noise>"), rows)


def _explained(fit: Fit) -> str:
    return percent(max(fit.explained, 0.0), round_down=True)
