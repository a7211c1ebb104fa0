"""The assessment of a truck: each measure with sigma, interval and the probability that a threshold is met."""

from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, field, replace
from itertools import chain
from typing import Any

import numpy as np

from fifthwheel.base import pages
from fifthwheel.base.arguments import expect, expect_known, expect_number, expect_road_speed
from fifthwheel.base.errors import FifthwheelError, VehicleError, suggestion
from fifthwheel.base.formatting import DisplayUnit, enumerated, percent, shown, with_sigma
from fifthwheel.base.names import split_kind
from fifthwheel.base.pages.html import Displayed
from fifthwheel.base.spelling import setting
from fifthwheel.estimate.identify import Estimate, Identification, Verdict
from fifthwheel.results.assess import (
    lane_change,
    longitudinal,
    low_speed_turn,
    rollover,
    steady_motion,
    yaw_damping,
)
from fifthwheel.results.assess.lane_change import LaneChangeRun
from fifthwheel.results.assess.measures import (
    EDITIONS,
    MEASURES,
    REAR,
    ROLLOVER,
    SCHEME,
    STOP,
    STRAIGHT,
    TRACKING,
    Limit,
    definition,
    title,
)
from fifthwheel.results.assess.propagation import (
    Family,
    MeasureSamples,
    Neighbourhood,
    Order,
    assumed,
    complete,
    of_identification,
    of_vehicle,
    samples,
)
from fifthwheel.results.assess.truck import HALF_TRACK, Body, Truck, Values
from fifthwheel.truck import Vehicle, unit_of
from fifthwheel.truck.driveline import Driveline
from fifthwheel.truck.spoken_names import spoken

_UNITS = {"m/s": DisplayUnit("km/h", 3.6), "s": DisplayUnit("s", 1.0)}
"""Units in which measures are shown, where others are shown otherwise."""
FAMILIES: tuple[Family, ...] = (
    rollover.measure,
    rollover.measure_effective_track,
    lane_change.measure,
    lane_change.measure_peak,
    yaw_damping.measure,
    yaw_damping.measure_pulse,
    yaw_damping.measure_zero_damping_speed,
    steady_motion.measure_understeer,
    steady_motion.measure_turn,
    steady_motion.measure_straight_path,
    low_speed_turn.measure,
    low_speed_turn.measure_circle,
    longitudinal.measure,
    longitudinal.measure_braking,
)
CHEAP: tuple[Family, ...] = (rollover.measure, lane_change.measure_peak, yaw_damping.measure)
"""Families without a simulation of a manoeuvre, for the report of an identification."""
SPEED = 88 / 3.6
"""Of the high-speed measures, m/s."""


def display_unit(unit: str) -> DisplayUnit:
    """The unit in which a measure is shown, by its unit."""
    return _UNITS.get(unit) or shown(unit)


def in_unit(value: float, unit: str) -> str:
    """A value of a measure in its display unit."""
    return f"{display_unit(unit).factor * value:.3g} {display_unit(unit).name}".rstrip()


@dataclass(frozen=True, kw_only=True)
class Threshold:
    """A threshold of a measure."""

    scheme: str
    level: str
    """"1" to "4", or "all"."""
    source: str
    """With its edition."""
    confirmed: bool
    """Whether the text of the source, or a second source, was read for this number."""
    sense: str
    """"at least" or "at most"."""
    value: float
    """SI; in the unit of the measure."""
    probability: float | None
    """That the truck meets it; None if the measure has no sigma."""

    def text(self, unit: str) -> str:
        """The threshold of a measure with this unit: "level 1: ≤ 0.6 m"; it names a scheme other than `SCHEME`."""
        sign = "≥" if self.sense == "at least" else "≤"
        level = "" if self.level == "all" else f"level {self.level}: "
        scheme = "" if self.scheme == SCHEME else f"{self.scheme}: "
        doubt = "" if self.confirmed else " (not confirmed)"
        return f"{scheme}{level}{sign} {in_unit(self.value, unit)}{doubt}"


@dataclass(frozen=True, kw_only=True)
class MeasureResult:
    """One measure of a truck."""

    name: str
    title: str
    unit: str
    """SI unit, "1", or "g"."""
    source: str
    value: float
    """Of the linear model."""
    sigma: float | None
    """None where the measure does not exist for all trucks within the uncertainty."""
    interval: tuple[float, float] | None
    """That contains 90 %."""
    order: Order | None
    """How sigma follows from the parameters: "linear", or "sampled" where a measure is strongly nonlinear."""
    thresholds: tuple[Threshold, ...]
    nonlinear: float | None = None
    """Of the nonlinear truck; None if it was not simulated."""

    def text(self) -> str:
        """Value, sigma and unit."""
        unit = display_unit(self.unit)
        sigma = None if self.sigma is None else unit.factor * self.sigma
        return f"{with_sigma(unit.factor * self.value, sigma, '1')} {unit.name}".rstrip()

    def best_threshold(self) -> Threshold | None:
        """The strictest threshold that is met with 50 % or more, else the mildest."""
        met = [t for t in self.thresholds if self.meets(t)]
        return met[0] if met else self.thresholds[-1] if self.thresholds else None

    def meets(self, threshold: Threshold) -> bool:
        """Whether the value meets a threshold."""
        return self.value >= threshold.value if threshold.sense == "at least" else self.value <= threshold.value


@dataclass(frozen=True, kw_only=True)
class Assessment(Displayed):
    """What a truck does: its performance-based measures, each with sigma.

    Example:
        >>> import fifthwheel as fw
        >>> assessment = fw.assess(fw.vehicle("cheng_cebon_2011"), nonlinear=False)
        >>> assessment
        Assessment(cheng_cebon_2011 at 88 km/h, 22 measures)
        >>> measure = assessment["rollover_threshold"]
        >>> measure.unit, measure.thresholds[0].value
        ('g', 0.35)
    """

    vehicle: Vehicle
    body: Body
    speed: float
    """m/s."""
    measures: tuple[MeasureResult, ...]
    uncertain: Mapping[str, float]
    """Sigma of each uncertain parameter by path, SI."""
    origin: str
    """Where the uncertainty comes from, in words."""
    unstable: float = 0.0
    """Fraction of the random trucks within the uncertainty that are unstable, 0 if none were needed; 1 if the truck
    itself is unstable."""
    notes: tuple[str, ...] = ()
    runs: Mapping[str, LaneChangeRun] = field(default_factory=dict, repr=False)
    """The lane change by model, "linear" and "nonlinear"."""

    def __getitem__(self, name: str) -> MeasureResult:
        """A measure by name; KeyError if the truck does not have it."""
        for measure in self.measures:
            if measure.name == name:
                return measure
        raise KeyError(f"{name}: not a measure of this truck; {suggestion(name, [m.name for m in self.measures])}")

    def __iter__(self) -> Iterator[MeasureResult]:
        return iter(self.measures)

    def __len__(self) -> int:
        return len(self.measures)

    @property
    def title(self) -> str:
        """Vehicle and speed."""
        return f"{self.vehicle.name} at {3.6 * self.speed:.0f} km/h"

    @property
    def instability(self) -> str:
        """A sentence on the fraction of trucks that are unstable; empty if none are."""
        if not self.unstable:
            return ""
        trucks = f"About {percent(self.unstable)} of the trucks within the uncertainty are"
        return f"{'the truck is' if self.unstable == 1 else trucks} unstable at this speed."

    def uncertain_units(self) -> Iterator[tuple[str, str, str]]:
        """Path, name in words and SI unit of each uncertain parameter."""
        for path in self.uncertain:
            yield path, spoken(path), "m" if path == HALF_TRACK else unit_of(path)

    def as_dict(self) -> dict[str, Any]:
        """The content of assessment.json: everything but time series."""
        return {
            "vehicle": self.vehicle.name,
            "units": {"speed": "m/s", "body": "m"},
            "speed": self.speed,
            "body": asdict(self.body),
            "measures": [asdict(measure) for measure in self.measures],
            "uncertain": {
                path: {"name": words, "sigma": self.uncertain[path], "unit": unit}
                for path, words, unit in self.uncertain_units()
            },
            "origin": self.origin,
            "unstable": self.unstable,
            "notes": list(self.notes),
        }

    def __repr__(self) -> str:
        return f"Assessment({self.title}, {len(self.measures)} measures)"

    def table(self) -> pages.Table:
        """Each measure with its threshold; without the column of the nonlinear truck if it was not simulated."""
        simulated = any(m.nonlinear is not None for m in self)
        heads = ("Measure|name", "Linear ± sigma>", *["Nonlinear>"] * simulated, "Threshold>", "Probability>")
        rows = []
        for measure in self:
            threshold, probability = measure.best_threshold(), ""
            if threshold and threshold.probability is not None:
                probability = percent(round(threshold.probability, 4))
            nonlinear = "" if measure.nonlinear is None else in_unit(measure.nonlinear, measure.unit)
            limit = threshold.text(measure.unit) if threshold else ""
            rows.append((measure.title, measure.text(), *[nonlinear] * simulated, limit, probability))
        return pages.Table(heads, rows)

    def _document(self) -> pages.Document:
        return pages.Document(self.title, [self.table(), pages.Items([*filter(None, [self.instability]), *self.notes])])


def assess(
    truck: Vehicle | Identification,
    *,
    speed: float = SPEED,
    body: Body | Mapping[str, float | str] | None = None,
    changes: Mapping[str, float] | None = None,
    sigmas: Mapping[str, float] | None = None,
    cheap: bool = False,
    nonlinear: bool = True,
) -> Assessment:
    """Performance-based measures of a truck, each with sigma, 90 % interval and the probability of its thresholds.

    docs/assess.md defines the measures.

    Args:
        truck: a vehicle, with the uncertainty of its file; or an identification, with its joint covariance.
        speed: of the high-speed measures, m/s.
        body: dimensions that a vehicle file does not have; `Body`, or its values by name.
        changes: values of parameters by path, SI, that replace those of the truck.
        sigmas: standard deviation of the changed parameters, SI; without one a changed parameter is exact.
        cheap: only rollover, damping and the peak of the rearward amplification, by linear propagation.
        nonlinear: also simulate the nonlinear truck; without MuJoCo a note says so.

    Raises:
        VehicleError: `truck` is neither, a parameter does not exist, or a dimension or a number of the driveline is out
                of its range.
        SignalError: the speed is out of range.

    Example:
        >>> import fifthwheel as fw
        >>> truck = fw.vehicle("cheng_cebon_2011")
        >>> low = fw.assess(truck, cheap=True)["rollover_threshold"]
        >>> high = fw.assess(truck, changes={"semitrailer.payload.height": 2.4}, cheap=True)["rollover_threshold"]
        >>> high.value < low.value
        True
    """
    expect_road_speed(speed)
    if isinstance(truck, Identification):
        vehicle, uncertainty = truck.vehicle, of_identification(truck)
        origin = f"the joint covariance of the identification by the {truck.method} method"
        if truck.covariance is None:
            origin = "the sigmas of the two-stage method, taken as independent, and the vehicle file"
    else:
        expect("truck", truck, Vehicle, Identification)
        vehicle, uncertainty = truck, of_vehicle(truck)
        origin = "the vehicle file"
        if count := len(assumed(truck)):
            origin += f"; {count} numbers on which it states nothing have the priors of an identification"
    given = dict(changes or {})
    size = body if isinstance(body, Body) else Body.of(body or {})
    of_driveline = {path: value for path, value in given.items() if path.startswith("driveline.")}
    if of_driveline and vehicle.driveline is None:
        vehicle = type(vehicle)(**vehicle.model_dump() | {"driveline": {}})
    subject = Truck(vehicle=vehicle.replace(given), body=size, speed=float(speed))
    for path, value in of_driveline.items():
        Driveline.require_plausible(path.partition(".")[2], value, path=path, written=f"{value:.4g}")
    expect_known("sigmas", sigmas or {}, given)
    for name, stated in (sigmas or {}).items():
        expect_number(f"sigmas, {name}", stated, ge=0)
    of_engine = {path: sigma for path, sigma in longitudinal.sigmas(subject.vehicle).items() if path not in given}
    stated_sigmas = {**of_engine, **(sigmas or {})}
    uncertainty = complete(uncertainty, size, replaced=(*given, *of_engine), stated=stated_sigmas)
    trucks = Neighbourhood(replace(subject, vehicle=longitudinal.completed(subject.vehicle)), uncertainty)
    results, notes, unstable = list[MeasureResult](), list[str](), float(not subject.is_stable)
    straight: MeasureSamples | None = None
    for family in CHEAP if cheap else FAMILIES:
        try:
            computed = samples(trucks, family, sampled=not cheap)
            results += [_result(name, computed) for name in computed.centre if name != REAR]
            straight = computed if STRAIGHT in computed.centre else straight
            unstable = max(unstable, _unstable(computed))
        except FifthwheelError as error:
            notes.append(str(error))
    if not results:
        raise VehicleError("; ".join(dict.fromkeys(notes)))
    driven, runs = Values(), dict[str, LaneChangeRun]()
    if not cheap:
        notes += _unstated(subject)
        of_engine = {r.name: r.value for r in results if r.name in longitudinal.NEEDED}
        notes += longitudinal.notes(subject, Values(of_engine)) if of_engine else []
        runs = {"linear": lane_change.linear(subject)} if subject.is_stable else {}
    if nonlinear and not cheap:
        from fifthwheel.results.assess.nonlinear import measures as nonlinear_measures  # slow to import

        driven, driven_runs, others = nonlinear_measures(subject)
        runs |= driven_runs
        notes += others
        for name in (TRACKING, STOP):
            if straight and name in driven:
                results.append(_result(name, straight.widened(STRAIGHT, name, driven[name] - driven[STRAIGHT])))
    results = [replace(r, nonlinear=driven.get(r.name)) for r in results]
    order = list(MEASURES)
    sigma = dict(zip(uncertainty.names, uncertainty.covariance.diagonal() ** 0.5, strict=True))
    return Assessment(
        vehicle=subject.vehicle,
        body=size,
        speed=subject.speed,
        measures=tuple(sorted(results, key=lambda r: order.index(split_kind(r.name)[0]))),
        uncertain={name: float(value) for name, value in sigma.items()},
        origin=origin,
        unstable=unstable,
        notes=tuple(dict.fromkeys(notes)),
        runs=runs,
    )


def rollover_threshold(identification: Identification) -> Estimate:
    """The static rollover threshold of an identified truck, as of `assess` with `cheap`.

    Its verdict is the worst of the CoG heights.

    Raises:
        VehicleError: the truck does not stand upright, or its axle loads are not determined.
    """
    body = Body()
    truck = Truck(vehicle=identification.vehicle, body=body, speed=SPEED)
    uncertainty = complete(of_identification(identification), body, stated={})
    found = _result(ROLLOVER, samples(Neighbourhood(truck, uncertainty), rollover.measure, sampled=False))
    heights = [e.verdict for e in identification.derived if e.path.quantity == "cog_height"]
    return Estimate(
        name=ROLLOVER,
        value=found.value,
        sigma=found.sigma,
        unit=found.unit,
        initial=rollover.measure(replace(truck, vehicle=identification.initial_vehicle))[ROLLOVER],
        verdict=max(heights, key=lambda verdict: verdict is not Verdict.CONVERGED, default=Verdict.FIXED),
        stage=2,
    )


def _unstable(computed: MeasureSamples) -> float:
    if "yaw_damping" not in computed.centre or not computed.draws:
        return 0.0
    return sum(draw.get("yaw_damping", -1.0) < 0 for draw in computed.draws) / len(computed.draws)


def _unstated(truck: Truck) -> list[str]:
    """What to state for the measures that lack a number of the body or of the driveline."""
    wanted = (
        (low_speed_turn.unstated(truck), f"by {setting('body')}"),
        (longitudinal.unstated(truck.vehicle), f"in [driveline] of the vehicle file, or by {setting('changes')}"),
    )
    return [
        f"Not assessed: {enumerated([title(name) for name in lacking])}; state"
        f" {', '.join(dict.fromkeys(chain(*lacking.values())))} {place}"
        for lacking, place in wanted
        if lacking
    ]


def _result(name: str, computed: MeasureSamples) -> MeasureResult:
    measure, spread = definition(name), computed.spread(lambda values: values[name])
    return MeasureResult(
        name=name,
        title=title(name),
        unit=measure.unit,
        source=measure.source,
        value=float(np.round(computed.centre[name], 12)),
        sigma=spread.sigma,
        interval=spread.interval,
        order=spread.order,
        thresholds=tuple(_threshold(name, limit, computed) for limit in measure.limits),
    )


def _threshold(name: str, limit: Limit, computed: MeasureSamples) -> Threshold:
    def margin(values: Values) -> float:
        difference = values[name] - limit.threshold(values)
        return difference if limit.sense == "at least" else -difference

    return Threshold(
        scheme=limit.scheme,
        level=limit.level,
        source=EDITIONS[limit.scheme],
        confirmed=limit.confirmed,
        sense=limit.sense,
        value=limit.threshold(computed.centre),
        probability=computed.probability(margin),
    )
