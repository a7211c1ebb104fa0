"""The gross mass of a vehicle, and mass and CoG of its laden units: driving, axle loads and weights in one estimate.

Unknown are the load of each laden unit, without a prior, and the numbers of the vehicle file, with its uncertainty as
independent changes N(0, 1) (`truck.uncertainty.changes`). Measured are the gross mass in driving (`longitudinal`) and
the static weights of the logs (`data.checks.axle_loads`), which follow from masses and positions by statics
(`truck.loads`; Cheng and Cebon 2011, section 2.2). Gauss-Newton steps give the least squares and their covariance.
"""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from fifthwheel.base.arguments import expect, expect_each
from fifthwheel.base.errors import SignalError, VehicleError
from fifthwheel.base.formatting import enumerated, with_sigma
from fifthwheel.base.types import Array
from fifthwheel.base.units import STANDARD_GRAVITY
from fifthwheel.data.channels import AXLE_LOAD, GROSS_WEIGHT, WEIGHT, WEIGHTS, SignalName, is_of, missing_for_mass
from fifthwheel.data.checks.axle_loads import PREFIX, mean_weights
from fifthwheel.data.checks.findings import Fault, Finding, warning
from fifthwheel.data.record import Record
from fifthwheel.estimate.identify.knowledge.load import LOAD_POSITION
from fifthwheel.estimate.identify.settings import CommonSettings
from fifthwheel.estimate.identify.verdict import Verdict
from fifthwheel.estimate.longitudinal import LOWEST_SPEED, DrivingMass, driving_mass
from fifthwheel.truck.loads import axle_loads
from fifthwheel.truck.uncertainty import changes
from fifthwheel.truck.vehicle import Vehicle

CONTRADICTION = 3.0
"""Joint standard deviations by which two masses contradict each other."""
PRIOR = 0.5
"""Standard deviation of ln(mass) without a log, for the verdict: an unladen vehicle has 40 % of the laden mass."""
ANY_LOAD = 1e7
"""Standard deviation of a load before it is measured, kg: no prior. It is finite, because one weight does not divide a
load among several units."""
STEPS = 5
"""Of Gauss-Newton; loads are bilinear in masses and positions."""
DRIVING = "driving"
"""Name of the gross mass in driving among the measurements."""


@dataclass(frozen=True, kw_only=True)
class GrossMass:
    """Result of `gross_mass`.

    Example:
        >>> import fifthwheel as fw
        >>> result = fw.GrossMass(mass=40e3, sigma=1e3, verdict=fw.Verdict.CONVERGED, parts={}, used=300.0)
        >>> result.deviation(36e3, 360.0) > 3
        True
    """

    mass: float
    """Of the whole vehicle, kg."""
    sigma: float
    """Standard deviation, kg."""
    verdict: Verdict
    """CONVERGED; NOT_EXCITED where the logs leave more than `CommonSettings.excited` of the prior sigma; DOUBTFUL where
    driving, weights and vehicle file contradict each other: chi squared is as improbable as `CONTRADICTION`."""
    parts: Mapping[str, float]
    """Contributions to sigma, kg: "driving" is that of the grade and the noise of the logs; of the scales of the force;
    "weights" of the scales on board; "vehicle_file" of positions and unladen masses."""
    used: float
    """Time with known force, s."""
    sources: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    """Gross mass and its standard deviation, kg, by "driving" and by "weights" alone."""
    units: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    """Value and standard deviation, SI, of masses and CoG of the laden units by path: "semitrailer.mass"."""
    residuals: Mapping[str, float] = field(default_factory=dict)
    """Of each measurement from the estimate, in its standard deviations."""

    def deviation(self, mass: float, sigma: float) -> float:
        """Difference from another mass, in joint standard deviations."""
        return _deviation((self.mass, self.sigma), (mass, sigma))


def gross_mass(records: Sequence[Record], vehicle: Vehicle) -> GrossMass:
    """Gross mass of a vehicle from logs with one load, by ordinary driving, axle loads and weights.

    Driving needs "speed", "braking.<unit>", and either "drive_force" or "engine_speed" and "engine_torque" (with
    "friction_torque" where the torque includes it). "driveline_engaged" makes gear changes informative, "grade"
    replaces the unknown grade. Samples count where the force is known: not while braking, below 1.5 m/s, near gear
    changes, or in gaps.

    Weights are "axle_load.<axle group>", "axle_load.<unit>" of all its axles, "weight.<unit>" and "gross_weight", at
    rest or driving straight. Without them, of the vehicle only the number of tyres and the driveline count for the
    gross mass.

    Args:
        records: of one load.
        vehicle: with its `[driveline]` if there is one; see `truck.driveline`.

    Raises:
        SignalError: a signal is missing, the brakes are never on although the vehicle brakes, or the force is known
            for less than 20 s; a weight has too few samples, or belongs to no unit and axle group of the vehicle.
        VehicleError: there are axle loads, and those of the vehicle are not determined.

    Example:
        >>> import fifthwheel as fw
        >>> from fifthwheel.model.plant.powered import DrivenTruck, drive
        >>> record, truck = drive(DrivenTruck(mass=30e3), seed=2), fw.vehicle("cheng_cebon_2011")
        >>> fw.gross_mass([record], truck).deviation(30e3, 0.0) < 3
        True
        >>> weights = {"gross_weight": [30e3 * 9.81] * 5}
        >>> round(fw.gross_mass([fw.Record(time=range(5), signals=weights)], truck).mass, -2)
        30000.0
    """
    from scipy.stats import chi2  # slow to import

    expect("vehicle", vehicle, Vehicle)
    expect_each("records", records, Record)
    if not records:
        raise SignalError("records: expected at least one, got none; give a log")
    weights = mean_weights(records)
    _require_known(weights, vehicle)
    driven = [record for record in records if not weights or _drives(record)]
    driving = driving_mass(driven, vehicle) if driven else None
    measured = {**weights, **({DRIVING: (driving.mass, driving.sigma)} if driving else {})}
    fit = _least_squares(vehicle, measured)
    sources = {DRIVING: measured[DRIVING]} if driving else {}
    if weights:
        sources["weights"] = (_least_squares(vehicle, weights) if driving else fit).results[DRIVING]
    mass, sigma = fit.results.pop(DRIVING)
    redundant = len(measured) - len(fit.results) // 2
    agree = redundant < 1 or fit.cost <= chi2.isf(math.erfc(CONTRADICTION / math.sqrt(2)), redundant)
    excited = sigma < CommonSettings.excited * PRIOR * mass
    return GrossMass(
        mass=mass,
        sigma=sigma,
        verdict=Verdict.NOT_EXCITED if not excited else Verdict.CONVERGED if agree else Verdict.DOUBTFUL,
        parts=_parts(fit, driving),
        used=driving.used if driving else 0.0,
        sources=sources,
        units=fit.results,
        residuals=fit.residuals,
    )


def mass_of_file(vehicle: Vehicle) -> tuple[float, float]:
    """Mass of the whole vehicle by its file, kg, and its standard deviation."""
    totals = [f"{unit.name}.mass" for unit in vehicle.units]
    sigmas = [sum(change.slopes.get(path, 0.0) for path in totals) for change in changes(vehicle)]
    return sum(unit.mass for unit in vehicle.units), math.hypot(*sigmas)


def mass_findings(records: Sequence[Record], vehicle: Vehicle) -> Iterator[Finding]:
    """The difference of the gross mass in logs of one load from that of the vehicle file, or of driving from weights,
    above `CONTRADICTION`.

    None where the logs do not determine the mass, or statics not the axle loads of the vehicle.
    """
    used = [r for r in records if not missing_for_mass(r.signals) or any(is_of(name, *WEIGHTS) for name in r.signals)]
    try:
        result = gross_mass(used, vehicle) if used else None
    except (SignalError, VehicleError):
        return
    file = mass_of_file(vehicle)
    if result is None or result.verdict is Verdict.NOT_EXCITED:
        return
    signals = {name for record in used for name in record.signals}
    weights = sorted(name for name in signals if is_of(name, *WEIGHTS))
    force = "drive_force" if "drive_force" in signals else "engine_torque"
    signal = force if DRIVING in result.sources else weights[0]
    log = enumerated([record.name for record in used])
    if result.verdict is Verdict.DOUBTFUL:
        yield warning(signal, Fault.MASS, contradiction(result), log=log)
    elif result.deviation(*file) > CONTRADICTION:
        masses = [_tonnes(*mass) for mass in ((result.mass, result.sigma), file)]
        problem = (
            f"with it the gross mass is {masses[0]}, and {masses[1]} by the vehicle file; stiffnesses scale with it"
        )
        scales = "the scales in [driveline] of the vehicle file" if signal == force else "the gain in signals.toml"
        cure = f"correct the payload with fifthwheel mass, or {scales}"
        yield warning(signal, Fault.MASS, f"{problem}; {cure}", log=log)


def contradiction(result: GrossMass) -> str:
    """The sentence on measurements that contradict each other or the vehicle file, with its cure."""
    if DRIVING not in result.sources or _deviation(*result.sources.values()) <= CONTRADICTION:
        worst = max(result.residuals, key=lambda name: abs(result.residuals[name]))
        return (
            f"{worst} differs by {abs(result.residuals[worst]):.1f} sigma from the other loads and the statics of the"
            " vehicle file; check that no loads are exchanged, their gain in signals.toml, and the masses and positions"
            " in the vehicle file"
        )
    driving, weights = (_tonnes(*result.sources[key]) for key in (DRIVING, "weights"))
    return (
        f"the gross mass is {driving} by driving, and {weights} by axle loads and weights; correct the scales in"
        " [driveline] of the vehicle file, or the gain of the loads in signals.toml"
    )


def _tonnes(mass: float, sigma: float) -> str:
    return with_sigma(mass / 1e3, sigma / 1e3, "t")


def _deviation(one: tuple[float, float], other: tuple[float, float]) -> float:
    """Difference of two numbers in joint standard deviations."""
    return abs(one[0] - other[0]) / math.hypot(one[1], other[1])


class _Fit(NamedTuple):
    """Of `_least_squares`."""

    results: dict[str, tuple[float, float]]
    """Gross mass as "driving", and masses and CoG of the laden units, with their standard deviations."""
    parts: dict[str, float]
    """Contribution of each measurement to the standard deviation of the gross mass, and "vehicle_file", kg."""
    residuals: dict[str, float]  # of each measurement, in its standard deviations
    cost: float  # sum of squares of the residuals, and of the changes of the vehicle file in their standard deviations


def _least_squares(vehicle: Vehicle, measured: Mapping[str, tuple[float, float]]) -> _Fit:
    """The masses and CoG positions that fit the measurements best."""
    laden = [unit for unit in vehicle.units if unit.payload] or [*(vehicle.units[1:] or vehicle.units)]
    results = [DRIVING, *(f"{unit.name}.{key}" for unit in laden for key in ("mass", "cog"))]
    before, uncertain = vehicle.parameters(), changes(vehicle)
    has_loads, widened = any(is_of(name, AXLE_LOAD) for name in measured), dict[str, float]()
    z, sigma = np.array([*measured.values()]).T
    prior = np.array([ANY_LOAD] * len(laden) + [1.0] * len(uncertain))

    def predicted(x: Array) -> Array:
        """The measurements, then the results."""
        p = dict(before)
        for unit, load in zip(laden, x, strict=False):
            p[f"{unit.name}.mass"] += load
        for change, size in zip(uncertain, x[len(laden) :], strict=True):
            for path, slope in change.slopes.items():
                p[path] += size * widened.get(path, slope)
        p |= _weights(vehicle, p, has_loads=has_loads)
        return np.array([p[name] for name in (*measured, *results)])

    n, x, steps = sigma.size, np.zeros(prior.size), np.where(prior > 1, 1.0, 0.01)
    for _ in range(STEPS):
        for unit, load in zip(laden, x, strict=False):  # as `with_payload` does
            own = [slope for change in uncertain if (slope := change.slopes.get(f"{unit.name}.cog"))]
            if own:
                widened[f"{unit.name}.cog"] = math.hypot(*own, LOAD_POSITION * load / (unit.mass + load))
        now = predicted(x)
        jacobian = np.array([(predicted(x + row) - now) / row.sum() for row in np.diag(steps)]).T * prior
        inverse = np.linalg.pinv(np.vstack([jacobian[:n] / sigma[:, None], np.eye(x.size)]))
        x = prior * (inverse[:, :n] @ ((z - now[:n] + jacobian[:n] @ (x / prior)) / sigma))
    gains = jacobian[n:] @ inverse  # of each measurement and each prior to the results
    now, sigmas = predicted(x), np.linalg.norm(gains, axis=1).tolist()
    residuals = (z - now[:n]) / sigma
    parts = dict(zip(measured, np.abs(gains[0, :n]).tolist(), strict=True))
    return _Fit(
        dict(zip(results, zip(now[n:].tolist(), sigmas, strict=True), strict=True)),
        parts | {"vehicle_file": float(np.linalg.norm(gains[0, n:]))},
        dict(zip(measured, residuals.tolist(), strict=True)),
        float(residuals @ residuals + (x / prior) @ (x / prior)),
    )


def _weights(vehicle: Vehicle, p: Mapping[str, float], *, has_loads: bool) -> dict[str, float]:
    """Every possible measurement of a vehicle with the parameters p: weights by signal, N, and the gross mass, kg."""
    masses = {unit.name: p[f"{unit.name}.mass"] for unit in vehicle.units}
    gross = sum(masses.values())
    found = {f"{WEIGHT.quantity}.{name}": STANDARD_GRAVITY * mass for name, mass in masses.items()}
    found |= {GROSS_WEIGHT.quantity: STANDARD_GRAVITY * gross, DRIVING: gross}
    if has_loads:
        loads = axle_loads(p, vehicle.units, vehicle.couplings)
        for unit in vehicle.units:
            groups = {path: loads[path] for group in unit.axle_groups if (path := unit.group_path(group)) in loads}
            found[f"{PREFIX}{unit.name}"] = sum(groups.values())
            found |= {f"{PREFIX}{path}": load for path, load in groups.items()}
    return found


def _drives(record: Record) -> bool:
    """Whether a record has the signals of driving, and the vehicle moves."""
    return not missing_for_mass(record.signals) and bool((record.signals["speed"] > LOWEST_SPEED).any())


def _require_known(names: Iterable[str], vehicle: Vehicle) -> None:
    """Raise where a weight is that of a unit or axle group that the vehicle does not have."""
    places = {unit.name for unit in vehicle.units}
    groups = places.union(vehicle.group_paths())
    for name in names:
        known = groups if is_of(name, AXLE_LOAD) else places
        if (place := SignalName.of(name).place) and place not in known:
            raise SignalError(
                f"{name}: {vehicle.name} has no {place}; it has {', '.join(sorted(known))}; correct the name in"
                " signals.toml"
            )


def _parts(fit: _Fit, driving: DrivingMass | None) -> dict[str, float]:
    """Contributions to the standard deviation of the gross mass, kg."""
    parts = dict(fit.parts)
    weight = parts.pop(DRIVING) / driving.sigma if driving else 0.0
    of_driving = {key: weight * part for key, part in driving.parts.items()} if driving else {}
    of_file = parts.pop("vehicle_file")
    return of_driving | ({"weights": math.hypot(*parts.values()), "vehicle_file": of_file} if parts else {})
