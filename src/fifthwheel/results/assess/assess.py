"""The assessment of a truck."""

from collections.abc import Mapping
from dataclasses import replace
from itertools import chain

import numpy as np

from fifthwheel.base.arguments import expect, expect_known, expect_number, expect_road_speed
from fifthwheel.base.errors import FifthwheelError, VehicleError
from fifthwheel.base.formatting import enumerated
from fifthwheel.base.names import split_kind
from fifthwheel.base.spelling import setting
from fifthwheel.estimate.identify import Estimate, Identification, Verdict
from fifthwheel.results.assess import (
    braking,
    lane_change,
    longitudinal,
    low_speed_turn,
    rollover,
    steady_motion,
    yaw_damping,
)
from fifthwheel.results.assess.assessment import Assessment, MeasureResult, Threshold
from fifthwheel.results.assess.lane_change import LaneChangeRun
from fifthwheel.results.assess.measures import (
    EDITIONS,
    MEASURES,
    REAR,
    ROLLOVER,
    STOP,
    STRAIGHT,
    TRACKING,
    Limit,
    definition,
    title,
)
from fifthwheel.results.assess.propagation import Family, MeasureSamples, Neighbourhood, samples
from fifthwheel.results.assess.truck import Body, Truck, Values
from fifthwheel.results.assess.uncertainty import assumed, complete, of_identification, of_vehicle
from fifthwheel.truck import Vehicle
from fifthwheel.truck.driveline import Driveline

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
    braking.measure,
)

CHEAP: tuple[Family, ...] = (rollover.measure, lane_change.measure_peak, yaw_damping.measure)
"""Families without a simulation of a manoeuvre, for the report of an identification."""
SPEED = 88 / 3.6
"""Of the high-speed measures, m/s."""


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
