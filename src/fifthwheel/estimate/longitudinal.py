"""The gross mass of a vehicle from ordinary driving, by the balance of its longitudinal forces.

    (m + m_rot) dv/dt = F - rho/2 CdA v^2 - m g (c_r + sin(grade))

With 1/m the balance is linear in 1/m and in the unknown grade, a random process over the travelled distance. Vahidi,
Stefanopoulou and Peng (2005, Vehicle System Dynamics 43) estimate both by recursive least squares with forgetting, and
McIntyre, Ghotikar, Vahidi, Song and Dawson (2009, IEEE Transactions on Vehicular Technology 58) in two stages. Here a
Kalman filter of grade and noise whitens the speed and its regressors, and 1/m follows by generalised least squares.
Changes of the force, at gear changes and when the driver lifts the throttle, separate mass and grade.

The grade is a random process over the travelled distance: white noise through two poles, the lengths of hills and of
vertical curves. Grade and noise are estimated by maximum a posteriori, the coefficients by generalised least squares
(de Jong 1991, The diffuse Kalman filter).
"""

import math
from collections.abc import Mapping, Sequence
from functools import partial
from typing import NamedTuple

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from fifthwheel.base.errors import SignalError
from fifthwheel.base.names import ends_with
from fifthwheel.base.native import Scan, compiled
from fifthwheel.base.types import Array
from fifthwheel.base.units import STANDARD_GRAVITY
from fifthwheel.data.channels import BRAKING, missing_for_mass, names_of
from fifthwheel.data.record import Record
from fifthwheel.estimate.filters.kalman import joseph
from fifthwheel.estimate.filters.model import pack, partitioned, unpack
from fifthwheel.truck.driveline import drag, driveline_numbers, rotating_mass
from fifthwheel.truck.vehicle import Vehicle

STEP = 0.2
"""Of the filter, s; samples within it are averaged."""
TOLERANCE = {"xatol": 0.02, "fatol": 0.02}
"""Of the logarithms of the noise, and of -2 ln of its density."""
UNKNOWN = 10.0
"""Standard deviation of the speed after a step with unknown force, m/s: nothing is known."""
NOISE_PRIOR = {
    "speed": (0.01, 1.0),  # m/s, white noise of a sample
    "acceleration": (0.01, 1.5),  # m/s^2 sqrt(s), white: gusts, driveline torsion
    "slope": (0.2, 0.7),  # m/s^2, of the slope: a grade of 2 %
    "known slope": (0.03, 0.7),  # m/s^2, of the error of a logged grade
    "hill": (400.0, 0.7),  # m, over which the grade is correlated
    "vertical curve": (50.0, 0.7),  # m, over which its change is correlated
}
"""Median, and standard deviation of the logarithm, of the standard deviations and length that the noise has."""
LONGEST_HOLD = 1.0
"""Time for which an engine signal or a flag may be missing, s."""
BESIDE_SERVICE_BRAKES = (0.3, 0.3)
"""Fraction of the braking force by engine and retarder where the service brakes act, and its standard deviation."""
ENGINE_ALONE = 0.05
"""Standard deviation of this fraction where the service brakes are off: trailers drag their brakes."""
LOWEST_SPEED = 1.5
"""m/s; below it the clutch slips, and power over speed does not give the force."""
SETTLING = 2
"""Steps before and after braking, gear changes and missing signals whose force counts as unknown."""
COASTING = 0.6
"""m/s^2; a truck that coasts loses 0.1 to 0.3 m/s^2, engine and air included, and more on a climb only, where it is
driven. A log that loses more, of which no brake is ever on, lacks its brakes."""
SLIPPING = 0.02
"""Fraction of the largest torque; while the driveline is not engaged and the engine gives more, as in a start or a
manoeuvre, the clutch slips and transmits an unknown part of it. Offset and quantisation are 1 % each."""
RATIO_RATE = 0.03
"""1/s; where engine speed over speed changes faster, the clutch is open or slips."""
TORQUE_OFFSET = 0.01
"""Standard deviation of a bias of the engine torque, as a fraction of its largest magnitude in the log."""
DELAY = 0.1
"""Standard deviation of the delay between force and speed, s."""
ANTICIPATION = 0.5
"""Standard deviation of the fraction of the force that drivers give for the hill they see: it is not independent of the
grade. Only changes of the force within less than a vertical curve then inform the mass. The lag is causal: later forces
answer to the speed, so that they would explain the grade by its own effect."""
HEAVIEST = 500e3
"""Largest mass, kg."""
SHORTEST = 20.0
"""Least time with known force, s."""
ITERATIONS = 4
"""Relinearisations about the mass and the delay."""
MEAN_GRADE = 0.01
"""Standard deviation of the mean grade of a log without a grade."""


def noise_prior(*, has_grade: bool) -> tuple[Array, Array]:
    """Means and standard deviations of the logarithms of the noise: speed, acceleration, slope, and its two lengths."""
    keys = ("speed", "acceleration", "known slope" if has_grade else "slope", "hill", "vertical curve")
    medians, sigmas = np.array([NOISE_PRIOR[key] for key in keys]).T
    return np.log(medians), sigmas


def fitted_noise(rows: Array, start: Array, prior: tuple[Array, Array], delay: float) -> Array:
    """The logarithms of the noise with the largest posterior density, from a start; see `least_squares`."""
    from scipy.optimize import minimize  # slow to import

    def cost(noise: Array) -> float:
        return least_squares(rows, noise, delay)[0] + float(np.sum(((noise - prior[0]) / prior[1]) ** 2))

    return np.asarray(minimize(cost, start, method="Nelder-Mead", options=TOLERANCE).x)


def least_squares(rows: Array, noise: Array, delay: float) -> tuple[float, Array, float]:
    """-2 ln likelihood, and the coefficients (k,), with the standard deviation of the first one, that of the force.

    The other coefficients have the prior N(0, 1); `delay` is what the speed has been corrected for, in units of its
    prior.
    """
    speed, acceleration, slope, hill, curve = np.exp(noise)
    moved, distance, *_ = rows.T
    k = rows.shape[1] - 5
    decays = np.exp(-distance[:, None] / [hill, curve])
    bend = slope**2 * (hill + curve) / (hill**2 * curve)  # variance of the change of the slope over the distance
    sample = np.column_stack(
        [
            moved,
            distance,
            decays,
            np.where(moved > 0, acceleration**2 * STEP, UNKNOWN**2),
            bend * (1 - decays[:, 1] ** 2),
            rows[:, 2:],
        ]
    )
    carry = np.zeros(6 + 3 * (k + 1))
    carry[:6] = UNKNOWN**2, 0.0, 0.0, slope**2, bend * hill * curve / (hill + curve), bend
    _, output = _whitening_step(k)(carry, sample, np.array([speed**2]))
    present = rows[:, 3] > 0
    variance, innovations = output[present, 0], output[present, 1:] / np.sqrt(output[present, :1])
    y, X = innovations[:, 0], -innovations[:, 1:]
    prior = np.zeros(k)
    prior[1] = -delay
    stacked, target = np.vstack([X, np.eye(k)[1:]]), np.concatenate([y, prior[1:]])
    Q, R = np.linalg.qr(stacked)
    beta = np.linalg.solve(R, Q.T @ target)
    residuals = target - stacked @ beta
    sigma = float(np.linalg.norm(np.linalg.inv(R)[0]))
    return float(np.sum(np.log(variance)) + residuals @ residuals), beta, sigma


@compiled(Scan)
def _whitening_step(k: int) -> ca.Function:
    """Kalman filter of the speed v, the slope s and its change c over the distance, for v (column 0) and k regressors.

    carry = [P packed, x (3, 1 + k)]; sample = [moved, distance, decays of s and c, variances of v and c, y, weight,
    inputs (1 + k)]; constant = [variance of y]; output = [innovation variance, innovations (1 + k)].
    """
    carry, P, flat = partitioned("carry", 6, 3 * (k + 1))
    sample, moved, distance, decays, q, y, weight, inputs = partitioned("sample", 1, 1, 2, 2, 1, 1, k + 1)
    r = ca.SX.sym("r")
    F = ca.vertcat(ca.horzcat(1, -STEP * moved, 0), ca.horzcat(0, decays[0], distance), ca.horzcat(0, 0, decays[1]))
    covariance = F @ unpack(P, 3) @ F.T + ca.diag(ca.vertcat(q[0], 0, q[1]))
    x = F @ ca.reshape(flat, 3, k + 1) + ca.vertcat(STEP * inputs.T, ca.SX.zeros(2, k + 1))
    row = ca.SX([[1, 0, 0]])
    variance, cross = covariance[0, 0] + r, covariance[:, 0]
    gain = weight * cross / variance
    innovations = ca.horzcat(y, ca.SX.zeros(1, k)) - x[0, :]
    carried = ca.vertcat(pack(joseph(covariance, cross, gain, row, r)), ca.reshape(x + gain @ innovations, -1, 1))
    output = ca.vertcat(variance, innovations.T)
    return ca.Function("gross_mass", [carry, sample, r], [ca.densify(carried), ca.densify(output)], {"cse": True})


class DrivingMass(NamedTuple):
    """Gross mass by the balance of the longitudinal forces."""

    mass: float  # kg
    parts: Mapping[str, float]
    """Contributions to its standard deviation, kg: "driving" is that of the logs, and those of the scales of the force.
    """
    used: float  # time with known force, s

    @property
    def sigma(self) -> float:
        """Standard deviation, kg."""
        return math.hypot(*self.parts.values())


def driving_mass(records: Sequence[Record], vehicle: Vehicle) -> DrivingMass:
    """The mass of a vehicle from the signals of driving; `mass.gross_mass` describes arguments and errors."""
    numbers, start = driveline_numbers(vehicle.driveline, vehicle.stated), sum(unit.mass for unit in vehicle.units)
    names = ", ".join(record.name for record in records)
    prior, mass, delay = noise_prior(has_grade="grade" in records[0].signals), start, 0.0
    noise = prior[0]
    for _ in range(ITERATIONS):
        rows = np.vstack([force_balance(record, vehicle, start, mass, delay) for record in records])
        used = STEP * float((rows[:, 0] > 0).sum())
        if used < SHORTEST:
            raise SignalError(
                f"{names}: the force is known for {used:.0f} s, at least {SHORTEST:g} s expected above"
                f" {LOWEST_SPEED:g} m/s without braking; log a longer drive, or check braking and driveline_engaged"
            )
        noise = fitted_noise(rows, noise, prior, delay / DELAY)
        _, coefficients, sigma = least_squares(rows, noise, delay / DELAY)
        beta, delay = float(coefficients[0]), delay + DELAY * float(coefficients[1])
        if not beta > start / HEAVIEST:
            cure = (
                "check the units and signs of the force or torque, and of speed"
                if beta < -3 * sigma
                else "log a drive with gear changes and accelerations"
            )
            raise SignalError(f"{names}: the acceleration does not follow the force; {cure}")
        mass = start / beta
    has_force = "drive_force" in records[0].signals
    powers = (
        {"torque_scale": 1, "speed_scale": 1} if has_force else {"torque_scale": 1, "efficiency": 1, "speed_scale": 2}
    )
    relative = {"driving": sigma / beta}
    relative |= {key: power * numbers[key][1] / numbers[key][0] for key, power in powers.items()}
    return DrivingMass(mass=mass, parts={key: fraction * mass for key, fraction in relative.items()}, used=used)


def force_balance(
    record: Record, vehicle: Vehicle, start: float, mass: float, delay: float, *, braked: bool = True
) -> Array:
    """Samples of `least_squares` from a record, without its noise: [moved, distance, y, weight, inputs].

    They are linearised about a mass, kg, and a delay of the speed, s; the first coefficient is `start` / mass. Where a
    brake acts, the force is unknown if `braked`, else that of the engine.
    """
    has_force = "drive_force" in record.signals
    if missing := missing_for_mass(record.signals):
        raise SignalError(
            f"{missing[0]}: not in {record.name}; the mass follows from speed, a signal of the brakes,"
            " and either drive_force or engine_speed and engine_torque; map a column to it in signals.toml"
        )
    numbers = driveline_numbers(vehicle.driveline, vehicle.stated)
    value, sigma = ({key: pair[i] for key, pair in numbers.items()} for i in (0, 1))
    wheels = sum(vehicle.tyres().values())
    hold, means = round(LONGEST_HOLD / STEP), partial(step_means, record)
    speed = means("speed", delay) / value["speed_scale"]
    v = _filled(speed, hold)
    moving = v > LOWEST_SPEED
    v = np.where(moving, v, LOWEST_SPEED)
    acceleration = np.gradient(np.convolve(np.pad(v, 2, mode="edge"), np.full(5, 0.2), "valid"), STEP)
    brakes = _brakes(record, names_of(BRAKING, record.signals))
    if not (brakes > 0).any() and (lost := -acceleration[moving].min(initial=0.0)) > COASTING:
        raise SignalError(
            f"{', '.join(names_of(BRAKING, record.signals))}: never on in {record.name}, although the speed falls by up"
            f" to {lost:.1f} m/s^2; map the signal of the brakes, or leave this part out"
        )
    interrupted = np.any(brakes != 0, axis=0) & braked
    engine, ratio, offset = np.zeros((3, v.size))
    if has_force:
        force = _filled(means("drive_force"), hold) / value["torque_scale"]
    else:
        revolutions, torque = (_filled(means(name), hold) for name in ("engine_speed", "engine_torque"))
        if "friction_torque" in record.signals:
            torque = torque - _filled(means("friction_torque"), hold)
        ratio = revolutions / v
        efficiency = np.where(torque > 0, value["efficiency"], 1 / value["efficiency"])
        force = efficiency * torque * ratio / value["torque_scale"]
        offset = TORQUE_OFFSET * np.nanmax(np.abs(torque), initial=0.0) * efficiency * ratio
        if "driveline_engaged" in record.signals:
            engaged = _held(means("driveline_engaged"), hold)
            interrupted = interrupted | ~np.isin(engaged, (0, 1)) | (np.diff(engaged, append=engaged[-1]) != 0)
            slips = np.abs(torque) > SLIPPING * np.nanmax(np.abs(torque), initial=0.0)
            interrupted = interrupted | ((engaged == 0) & slips)
            force, ratio, offset = (np.where(engaged > 0, x, 0.0) for x in (force, ratio, offset))
        else:
            rate = (np.roll(ratio, -3) - np.roll(ratio, 3)) / (6 * STEP * np.maximum(ratio, 1e-3))
            interrupted = interrupted | ~(np.abs(rate) < RATIO_RATE)
        engine = ratio**2
    has_grade = "grade" in record.signals
    slope, mean_grade = (_filled(means("grade"), hold), 0.0) if has_grade else (np.zeros(v.size), MEAN_GRADE)
    slope = slope / np.hypot(1.0, slope)
    rotating = rotating_mass(wheels, value["rotating_mass"], value["engine_inertia"], engine)
    net = force - drag(value["drag_area"], v)
    moved = mass / (mass + rotating)
    driven = moved * net / mass  # acceleration by the force; unlike the measured one, it has no noise of the speed
    inertia = rotating * acceleration  # counts for the change of the mass since the last linearisation only
    inputs = np.column_stack(
        [
            inertia / mass - STANDARD_GRAVITY * (slope + value["rolling_resistance"]),
            (net - inertia) / start,
            -DELAY / mass * (np.gradient(force, STEP) + np.where(ratio > 0, force * driven / v, 0.0)),
            offset / mass,
            -drag(sigma["drag_area"], v) / mass,  # 5 % of weather and altitude are within it
            -wheels / mass * sigma["rotating_mass"] * driven,
            -sigma["engine_inertia"] / mass * engine * driven,
            -ANTICIPATION / mass * _smoothed(force, v * STEP / NOISE_PRIOR["vertical curve"][0]),
            np.full(v.size, STANDARD_GRAVITY * math.hypot(sigma["rolling_resistance"], mean_grade)),
        ]
    )
    known = np.logical_not(
        _widened(interrupted | ~moving | np.isnan(speed) | ~np.isfinite(inputs).all(axis=1), SETTLING)
    )
    inputs = np.where(known[:, None], moved[:, None] * inputs, 0.0)
    both = np.append(False, np.logical_and(known[1:], known[:-1]))  # ends of the step before a sample
    averaged = np.vstack([inputs[:1], (inputs[1:] + inputs[:-1]) / 2])
    present = np.isfinite(speed)
    distance = np.maximum(np.nan_to_num(_filled(speed, speed.size)), 0.0) * STEP
    sample = [np.where(both, moved, 0.0), distance, np.where(present, speed, 0.0), present]
    return np.column_stack([*sample, np.where(both[:, None], averaged, 0.0)])


def unbraked(record: Record) -> NDArray[np.bool_]:
    """Whether no brake acts at the ends of each step (N,) of `force_balance`, nor shortly before or after."""
    free = ~_widened(np.any(_brakes(record, names_of(BRAKING, record.signals)) != 0, axis=0), SETTLING)
    return np.append(False, free[1:] & free[:-1])


def drive_axle_braking(record: Record) -> tuple[float, float] | None:
    """The fraction of the braking force by engine and retarder, and its standard deviation; None without a signal of
    the service brakes.

    It is 1 where the service brakes are off, and `BESIDE_SERVICE_BRAKES` where they act.
    """
    names = [name for name in names_of(BRAKING, record.signals) if not ends_with(name, "retarder")]
    speed = _filled(step_means(record, "speed"), round(LONGEST_HOLD / STEP)) if names else np.zeros(0)
    slower = np.nan_to_num(np.maximum(-np.gradient(speed, STEP), 0.0)) if speed.size > 1 else np.zeros(0)
    if not (total := float(slower.sum())):
        return None
    off = float(slower @ np.all(_brakes(record, names) == 0, axis=0)) / total
    mean, sigma = BESIDE_SERVICE_BRAKES
    return off + (1 - off) * mean, math.hypot(ENGINE_ALONE, (1 - off) * sigma)


def _brakes(record: Record, names: Sequence[str]) -> Array:
    """Signals of the brakes (n, N), NaN where they are missing."""
    return np.array([_held(step_means(record, name), round(LONGEST_HOLD / STEP)) for name in names])


def step_means(record: Record, name: str, delay: float = 0.0) -> Array:
    """Means (N,) of a signal over the steps of the filter, NaN where a step has no sample; of a late signal, corrected
    by its delay, s."""
    time, values = record.time, record.signals[name]
    index = np.floor((time - time[0]) / STEP + 1e-6).astype(int)
    size, present = int(index[-1]) + 1, np.isfinite(values)
    if delay and present.any():
        values = np.interp(time, time[present] - delay, values[present])
    counts, sums = np.bincount(index[present], minlength=size), np.bincount(index[present], values[present], size)
    return np.asarray(np.divide(sums, counts, out=np.full(size, np.nan), where=counts > 0))


def _filled(values: Array, longest: int) -> Array:
    """Values (N,) with gaps of at most `longest` steps interpolated; others are NaN."""
    present = np.flatnonzero(np.isfinite(values))
    if not present.size:
        return values
    rows = np.arange(values.size)
    after = np.clip(np.searchsorted(present, rows), 0, present.size - 1)
    before = np.clip(np.searchsorted(present, rows, side="right") - 1, 0, present.size - 1)
    near = np.maximum(np.abs(rows - present[before]), np.abs(present[after] - rows)) <= longest
    return np.where(near, np.interp(rows, present, values[present]), np.nan)


def _held(values: Array, longest: int) -> Array:
    """A flag (N,) with its last value in gaps of at most `longest` steps."""
    last = np.maximum.accumulate(np.where(np.isfinite(values), np.arange(values.size), -1))
    recent = (last >= 0) & (np.arange(values.size) - last <= longest)
    return np.where(recent, values[np.maximum(last, 0)], np.nan)


def _smoothed(values: Array, ratios: Array) -> Array:
    """Values (N,), 0 where missing, after a first-order lag; ratios (N,) of the step to its length."""
    state, result = 0.0, np.empty(values.size)
    for k, (value, ratio) in enumerate(zip(np.nan_to_num(values).tolist(), ratios.tolist(), strict=True)):
        state += ratio / (1 + ratio) * (value - state)
        result[k] = state
    return result


def _widened(mask: NDArray[np.bool_], steps: int) -> NDArray[np.bool_]:
    """A mask (N,) that also has so many steps before and after each of its own."""
    return np.asarray(np.convolve(mask, np.ones(2 * steps + 1), "same") > 0)
