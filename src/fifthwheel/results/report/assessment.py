"""The pages of an assessment: its report, its section in that of an identification, and the evidence on an A4 page."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import fifthwheel
from fifthwheel.base import pages
from fifthwheel.base.atomic import file_digest
from fifthwheel.base.errors import FifthwheelError
from fifthwheel.base.formatting import approximate, enumerated, fixed, with_sigma
from fifthwheel.base.pages import html
from fifthwheel.base.plots import Axis, Guide, Item, Line, Panel, Plot
from fifthwheel.base.plots.items import CYCLE, DARK, GREY, Dash
from fifthwheel.base.spelling import setting
from fifthwheel.base.types import Array
from fifthwheel.estimate.identify import Identification
from fifthwheel.results.assess import Assessment, MeasureResult
from fifthwheel.results.assess.lane_change import LaneChangeRun
from fifthwheel.results.assess.low_speed_turn import RADIUS, LowSpeedTurn, turn
from fifthwheel.results.assess.measures import DYNAMIC, EDITIONS, ROLLOVER, SCHEME
from fifthwheel.results.assess.rollover import Rollover, rollover
from fifthwheel.results.assess.truck import HALF_TRACK, Truck
from fifthwheel.results.report.provenance import FILES, FileUsed, Provenance
from fifthwheel.truck import unit_of
from fifthwheel.truck.spoken_names import named_unit, spoken

Runs = Mapping[str, LaneChangeRun]
"""The lane change by model, "linear" and "nonlinear"."""
LIKELY = 0.95
"""Probability from which a threshold counts as met without doubt."""
DASHES: Mapping[str, Dash] = {"linear": "solid", "nonlinear": "dash"}
SHOWN = 15.0
"""Distance that the last coupling drives beyond the circle in the picture, m."""
OUTLINES = 7
"""Drawn positions of the truck in the low-speed turn."""
PARAMETERS = ("Parameter|name", "Value ± sigma>", "Verdict|w")
SHOWN_PARAMETERS, SHOWN_FILES = 20, 8
"""Rows on the page; the JSON file has all."""


def write_assessment_report(
    path: Path, assessment: Assessment, *, provenance: Provenance | None = None, figures: str | None = None
) -> list[Path]:
    """Write the page of an assessment as one HTML file; arguments, result and errors as of `write_report`."""
    truck = Truck(vehicle=assessment.vehicle, body=assessment.body, speed=assessment.speed)
    blocks: list[pages.Block] = [
        pages.Headline(headline(assessment), is_good(assessment)),
        pages.Heading("Measures", key="measures"),
        assessment.table(),
        pages.Items(explanations(assessment)),
        *(_lane_change(assessment.runs) if assessment.runs else ()),
        *_turns(truck),
        pages.Heading("Uncertain parameters", key="uncertain"),
        pages.Hint("Standard deviation of each uncertain parameter. A parameter that is not listed is exact."),
        pages.Table(
            ("Parameter|name", "Sigma>"),
            [
                (pages.Hinted(words, path), approximate(assessment.uncertain[path], unit))
                for path, words, unit in assessment.uncertain_units()
            ],
        ),
        *(provenance.blocks() if provenance is not None else ()),
    ]
    subtitle = f"What this truck does, fifthwheel {fifthwheel.__version__}"
    return html.write(path, pages.Document(assessment.title, blocks, subtitle), images=figures)


def section(assessment: Assessment) -> Iterator[pages.Block]:
    """The section of the report of an identification: the measures, and how to get all of them."""
    yield pages.Heading("What this truck will do", key="performance")
    half_track = f"{assessment.body.half_track:g} m ± {assessment.body.half_track_sigma:g} m"
    yield pages.Hint(
        f"Predicted by the linear model of the identified truck at {3.6 * assessment.speed:.0f} km/h. Sigma is that of "
        f"the parameters, with the half track taken as {half_track}. fifthwheel assess on this folder computes all "
        "measures, at any speed and payload, beside the nonlinear truck."
    )
    yield assessment.table()
    yield from map(pages.Hint, assessment.notes)


def assessment_document(assessment: Assessment) -> pages.Document:
    """Each measure with sigma, the nonlinear truck, the threshold and the probability that it is met."""
    blocks = (
        pages.Headline(headline(assessment), is_good(assessment)),
        assessment.table(),
        pages.Items(explanations(assessment), "Notes"),
    )
    return pages.Document(assessment.title, blocks)


def verdict(measure: MeasureResult) -> str:
    """Whether a measure meets its threshold, and surely: with a probability of `LIKELY` or more."""
    threshold = measure.best_threshold()
    if threshold is None:
        return ""
    if not measure.meets(threshold):
        return "missed"
    return "met" if threshold.probability is None or threshold.probability >= LIKELY else "met, not surely"


def with_verdict(assessment: Assessment, words: str) -> list[MeasureResult]:
    """Measures with a threshold of `SCHEME` and this verdict."""
    return [m for m in assessment if verdict(m) == words and (t := m.best_threshold()) and t.scheme == SCHEME]


def is_good(assessment: Assessment) -> bool:
    """Whether every threshold is met, and the truck is stable, without doubt."""
    unsure = with_verdict(assessment, "missed") or with_verdict(assessment, "met, not surely")
    return not unsure and assessment.unstable <= 1 - LIKELY


def headline(assessment: Assessment) -> str:
    """Whether the truck meets its thresholds, and surely; of an unstable truck that it is unstable."""
    missed = with_verdict(assessment, "missed")
    if assessment.unstable == 1:
        also = f" It misses {enumerated([m.title for m in missed])}." if missed else ""
        return f"{assessment.title}: {assessment.instability}{also}"
    if missed:
        result = f"misses {enumerated([m.title for m in missed])}"
    else:
        result = f"meets all thresholds of the {SCHEME} that are assessed"
        if uncertain := with_verdict(assessment, "met, not surely"):
            result += f", but with its uncertainty not surely those of {enumerated([m.title for m in uncertain])}"
    return f"{assessment.title}: {result}. {assessment.instability}".rstrip()


def explanations(assessment: Assessment) -> list[str]:
    """What sigma, thresholds and assumed dimensions mean."""
    body = assessment.body
    sigma = body.half_track_sigma or None
    overhang = "rear overhang unknown" if body.rear_overhang is None else f"rear overhang {body.rear_overhang:g} m"
    others = "".join(f", {name} {value:g} m" for name, value in body.between.items())
    whole = sum(body.brakes.values())
    others += "".join(f", brakes.{path} {share / whole:.0%}" for path, share in body.brakes.items())
    notes = [
        *assessment.notes,
        *_above_static(assessment),
        f"Sigma: from {assessment.origin}.",
        f"Body: half track {with_sigma(body.half_track, sigma, 'm')}, width {body.width:g} m, front overhang "
        f"{body.front_overhang:g} m, {overhang}{others}. A vehicle file does not have these numbers: give them by "
        f"{setting('body')}.",
        "Thresholds: strictest level that is met of the Australian performance-based standards (2008), or of the "
        "source that is named; not confirmed: check the number in the current rules. "
        "The linear model decides, of the tracking ability with what the roughness adds to the nonlinear truck; "
        "probability: that the truck meets it, given the sigma. A number without a unit is a ratio.",
    ]
    if sampled := [m.title for m in assessment if m.order == "sampled"]:
        notes.append(f"Sampled, because not linear in the parameters: {enumerated(sampled)}.")
    if unknown := [m.title for m in assessment if m.sigma is None]:
        notes.append(f"Without sigma, because not every truck within the uncertainty has them: {enumerated(unknown)}.")
    return notes


def _above_static(assessment: Assessment) -> Iterator[str]:
    """Why a dynamic rollover threshold is above the static one of its model."""
    found = {m.name: (m.value, m.nonlinear) for m in assessment if m.name in (ROLLOVER, DYNAMIC)}
    if len(found) < 2:
        return
    pairs = zip(("linear", "nonlinear"), found[ROLLOVER], found[DYNAMIC], strict=True)
    if above := [model for model, static, dynamic in pairs if static and dynamic and dynamic > static]:
        yield (
            f"The dynamic rollover threshold ({' and '.join(above)}) is above the static one, which then limits: it is "
            "the acceleration of the front axle, and at this speed the units behind have less, or have theirs later. "
            "It is extrapolated from 0.15 g in proportion, without wheels that lift before."
        )


def _lane_change(runs: Runs) -> Iterator[pages.Block]:
    ratio = "load transfer ratio"
    yield pages.Heading("Lane change", key="lane-change")
    yield pages.Hint(
        "Single lane change of ISO 14791: one sine of 0.15 g at 0.4 Hz at the front axle. Dashed: nonlinear."
    )
    yield pages.Plots(
        [
            _figure("From above", "paths", _paths(runs), note="Front axle, and last axle of each unit."),
            _over_time("Lateral acceleration", "lateral acceleration", "m/s²", runs, lambda run: run.acceleration),
            _over_time("Roll angle", "roll", "deg", runs, lambda run: {n: np.degrees(v) for n, v in run.roll.items()}),
            _over_time("Load transfer ratio", ratio, "", runs, lambda run: {ratio: run.load_transfer}),
        ]
    )


def _turns(truck: Truck) -> Iterator[pages.Block]:
    figures = []
    try:
        above = turn_from_above(truck, turn(truck))
        figures.append(_figure("Low-speed turn of 90°", "low-speed turn", above))
        note = "A vertical line marks the lift of the inner wheels of an axle group."
        rolling = roll_by_acceleration(rollover(truck))
        figures.append(_figure("Roll in a steady turn", "roll in a steady turn", rolling, note=note))
    except FifthwheelError:  # a note on the measure says why
        pass
    if figures:
        yield pages.Heading("Turns", key="turns")
        yield pages.Plots(figures)


def _figure(caption: str, name: str, panel: Panel, *, group: str = "", note: str = "") -> pages.CaptionedPlot:
    return pages.CaptionedPlot(caption, Plot(panels=[panel]), group or name, ("truck", "assessment", name), note=note)


def _paths(runs: Runs) -> Panel:
    items: list[Item] = []
    for model, run in runs.items():
        for name in ("front", *run.roll):
            x, y, colour = run.x[name], run.y[name], _colour(run, name)
            items.append(Line(x, y, name=_name(name, model), colour=colour, dash=DASHES[model]))
    return Panel(items=items, x=Axis(label="along the road", unit="m"), y=Axis(label="across the road", unit="m"))


def _over_time(
    caption: str, title: str, unit: str, runs: Runs, series: Callable[[LaneChangeRun], Mapping[str, Array]]
) -> pages.CaptionedPlot:
    items: list[Item] = []
    for model, run in runs.items():
        for name, values in series(run).items():
            items.append(Line(run.time, values, name=_name(name, model), colour=_colour(run, name), dash=DASHES[model]))
    panel = Panel(items=items, x=Axis(label="time", unit="s"), y=Axis(unit=unit))
    return _figure(caption, title, panel, group="lane change")


def _colour(run: LaneChangeRun, name: str) -> str:
    """The same in all plots, which share a legend: that of the unit, as in the plots of turns."""
    units = list(run.roll)
    return CYCLE[units.index(name) % len(CYCLE)] if name in units else DARK


def _name(name: str, model: str) -> str:
    return f"{'front axle' if name == 'front' else named_unit(name)}, {model}"


def turn_from_above(truck: Truck, run: LowSpeedTurn) -> Panel:
    """The units at some instants of the low-speed turn, and the paths of the first and the last axle."""
    items: list[Item] = []
    shown = int(np.argmax(np.append(run.origins[:, -1].imag > RADIUS + SHOWN, True))) or len(run.steer)
    width, last = truck.body.width, len(truck.vehicle.units) - 1
    for i, (unit, (rear, front)) in enumerate(zip(truck.vehicle.units, truck.ends(), strict=True)):
        corners = np.array([front + 0.5j * width, rear + 0.5j * width, rear - 0.5j * width, front - 0.5j * width])
        outlines = [
            np.append(run.origins[row, i] + np.append(corners, corners[0]) * np.exp(1j * run.headings[row, i]), np.nan)
            for row in np.linspace(0, shown - 1, OUTLINES).astype(int)
        ]
        outline = np.concatenate(outlines)
        colour = CYCLE[i % len(CYCLE)]
        items.append(Line(outline.real, outline.imag, name=named_unit(unit.name), colour=colour, width=1.2))
    for name, i, axle in (("first axle", 0, truck.front_axle), ("last axle", last, truck.rear_axle)):
        path = (run.origins[:, i] + axle.position * np.exp(1j * run.headings[:, i]))[:shown]
        items.append(Line(path.real, path.imag, name=name, colour=GREY, width=1.5, dash="dash"))
    return Panel(items=items, x=Axis(label="x", unit="m"), y=Axis(label="y", unit="m"), equal=True)


def roll_by_acceleration(sets: tuple[Rollover, ...]) -> Panel:
    """Roll angle of each unit against the lateral acceleration of a steady turn, with the lift of each axle group."""
    items: list[Item] = [
        Line(acceleration, np.degrees(roll), name=named_unit(name))
        for s in sets
        for name, (acceleration, roll) in s.roll.items()
    ]
    lifts = [lift for s in sets for lift in s.lifts.values()]
    items += [Guide(x=lift, colour="#bbbbbb", width=1, dash="solid") for lift in lifts]
    return Panel(items=items, x=Axis(label="lateral acceleration", unit="g"), y=Axis(label="roll", unit="deg"))


class AssessedParameter(NamedTuple):
    """A parameter of an assessed truck."""

    name: str
    value: float
    sigma: float | None
    """None: exact. Both SI."""
    unit: str
    verdict: str
    """Of an estimate, or "stated" by a file or the user, or "assumed"."""


@dataclass(frozen=True, kw_only=True)
class TruckEvidence:
    """What an assessment says of a truck, and what it was made from."""

    assessment: Assessment
    identification: Identification | None = None
    conclusion: Sequence[str] = ()
    """Sentences on the identification."""
    provenance: Provenance = field(default_factory=Provenance)

    def as_dict(self) -> dict[str, Any]:
        """The content of assessment.json."""
        return self.assessment.as_dict() | {
            "parameters": [parameter._asdict() for parameter in self.parameters()],
            "identification": list(self.conclusion),
            "provenance": self.provenance.as_dict(),
        }

    def parameters(self) -> list[AssessedParameter]:
        """The estimates; then every other uncertain number: what is stated first, then the largest relative sigma.

        An estimate that `changes` of the assessment replace is stated; what was derived from it is left out.
        """
        vehicle, found = self.assessment.vehicle, self.identification
        values = vehicle.parameters() | vehicle.derived()
        before = values if found is None else found.vehicle.parameters() | found.vehicle.derived()
        changed = {path for path, value in vehicle.parameters().items() if value != before.get(path)}
        estimates = () if found is None else (*found.parameters, *found.derived)
        kept = [e for e in estimates if values.get(e.name, e.value) == before.get(e.name, e.value)]
        rows = [AssessedParameter(e.name, e.value, e.sigma, e.unit, str(e.verdict)) for e in kept]
        others = (self.assessment.uncertain.keys() | changed) - {HALF_TRACK} - {e.name for e in kept}
        stated = vehicle.stated.keys() | changed
        sigmas = self.assessment.uncertain
        more = [
            AssessedParameter(
                path, values[path], sigmas.get(path), unit_of(path), "stated" if path in stated else "assumed"
            )
            for path in values
            if path in others
        ]
        return rows + sorted(more, key=lambda p: (p.verdict != "stated", -(p.sigma or 0.0) / (abs(p.value) or 1.0)))

    def document(self, contents: Path) -> pages.Document:
        """One A4 page; it has the digest of the JSON file with the `contents` of this evidence too."""
        assessment, size = self.assessment, contents.stat().st_size
        own = FileUsed(path=contents.name, size=size, sha256=file_digest(contents))
        parameters, files = self.parameters(), [own, *self.provenance.files]
        masses = fixed(sum(unit.mass for unit in assessment.vehicle.units), 0)
        blocks = [
            pages.Headline(headline(assessment), is_good(assessment)),
            *map(pages.Paragraph, self.conclusion),
            pages.Heading("Measures and thresholds"),
            _measures(assessment),
            pages.Heading("Parameters"),
            _parameters(parameters[:SHOWN_PARAMETERS]),
            pages.Heading("Files"),
            pages.Table(FILES, [file.row() for file in files[:SHOWN_FILES]]),
            pages.Items([*self._remarks(len(parameters) - SHOWN_PARAMETERS, len(files) - SHOWN_FILES)]),
        ]
        subtitle = f"Evidence by fifthwheel {fifthwheel.__version__}, {self.provenance.time}. Mass {masses} kg"
        return pages.Document(assessment.title, blocks, subtitle, sheet=True)

    def _remarks(self, parameters: int, files: int) -> Iterator[str]:
        """What the page leaves out, what its numbers mean, and how to verify them."""
        if self.provenance.command:
            yield f"Command: {self.provenance.command}"
        left_out = [f"{n} further {what}" for n, what in ((parameters, "parameters"), (files, "files")) if n > 0]
        if left_out:
            yield f"Only in assessment.json: {' and '.join(left_out)}."
        schemes = {t.scheme for m in self.assessment for t in m.thresholds}
        yield f"Sources of the thresholds: {'; '.join(EDITIONS[name] for name in EDITIONS if name in schemes)}."
        yield from explanations(self.assessment)
        yield "Verify the files: fifthwheel verify FOLDER. This is an engineering estimate and no certificate."


def write_evidence(path: Path, evidence: TruckEvidence, contents: Path) -> None:
    """Write the page of an evidence as one HTML file; `contents` is its JSON file."""
    html.write(path, evidence.document(contents))


def _measures(assessment: Assessment) -> pages.Table:
    table = assessment.table()
    rows = [(row[0], m.source, *row[1:], verdict(m)) for m, row in zip(assessment, table.rows, strict=True)]
    return pages.Table((table.heads[0], "Source", *table.heads[1:], "Verdict|w"), rows)


def _parameters(parameters: Sequence[AssessedParameter]) -> pages.Block:
    rows = [(spoken(p.name), with_sigma(p.value, p.sigma, p.unit), p.verdict.replace("_", " ")) for p in parameters]
    half = (len(rows) + 1) // 2
    return pages.Beside([pages.Table(PARAMETERS, rows[:half]), pages.Table(PARAMETERS, rows[half:])])
