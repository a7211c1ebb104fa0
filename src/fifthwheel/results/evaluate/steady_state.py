"""Steady-state circular tests, ISO 14792:2011: understeer, sideslip and roll gradient.

In a steady turn with curvature k = r / u and lateral acceleration a = u r of the first unit

    steer = steer_0 + L k + K a + T a',                                                                       (1)

K is the understeer gradient, L the equivalent wheelbase (`dynamics.steady_steer`), and T a' the lag of a turn that
changes slowly. One least-squares fit of steer - L k on a holds for all three methods: constant radius (k is constant),
constant speed (k = a / u^2) and constant steer angle. Sideslip and roll angle are fitted on a in the same way.

Data are means over `BLOCK`, while the lateral acceleration changes slowly. Sigma is that of a jackknife over segments
of consecutive data, which road and wind affect together; that of K contains the uncertainty of the wheelbase in the
vehicle file. It is without a scale error of the steer angle or speed.

Left and right turns also have their own fits of equation (1), each with a steer_0. The offset of the sensor and a
constant bank are in both steer_0 alike; play of the steering and bends that are banked inwards are their difference.
Neither changes the gradient of one direction. So a difference of the gradients is a property of the truck or of the
sensor of its steer angle.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fifthwheel.base.errors import SignalError
from fifthwheel.base.formatting import approximate, percent, with_sigma
from fifthwheel.base.types import Array
from fifthwheel.data.channels import ROLL, SIDESLIP, SignalName
from fifthwheel.model.dynamics import steady_steer
from fifthwheel.results.assess.propagation import Neighbourhood, of_vehicle, samples
from fifthwheel.results.assess.truck import Truck
from fifthwheel.results.evaluate.evaluation import EvaluatedMeasure, MethodResult
from fifthwheel.results.evaluate.motion import MeasuredMotion
from fifthwheel.truck import Vehicle
from fifthwheel.truck.spoken_names import named_unit

SEGMENTS = 10
"""Of the jackknife."""
SPAN = 0.8
"""Least range of the lateral acceleration without any one of the segments, m/s^2."""
TURNING = 0.3
"""Least lateral acceleration of a turn to one side, m/s^2: about straight ahead, play hides the direction."""
LEAST_PLAY = math.radians(0.02)
"""A smaller difference of the offsets is no play: the curve of the tyre forces makes one of 0.01 degrees."""
SIGNIFICANT = 3.0
"""Standard deviations by which left and right differ significantly: with 9 degrees of freedom 1.5 % by chance."""
GRADIENT = "rad s^2/m"
BLOCK = 1.0
"""Time over which the signals are averaged, s."""
CHANGE = 0.8
"""Largest change of the lateral acceleration from block to block, m/s^2."""
RECOMMENDED = 0.2
"""Rate of the lateral acceleration above which a note says that the turn is not steady, m/s^3."""
LINEAR = 2.0
"""Lateral acceleration up to which the gradients are fitted, m/s^2."""
CONSTANT = 0.05
"""Relative standard deviation of a quantity that counts as constant."""


def suffices(acceleration: Array) -> bool:
    """Whether blocks with this lateral acceleration determine a gradient."""
    return acceleration.size >= SEGMENTS + 2 and span(acceleration) >= SPAN


def span(acceleration: Array) -> float:
    """Least range of the lateral acceleration (n,) without one segment, m/s^2: one turn has one acceleration only."""
    if acceleration.size < SEGMENTS:
        return 0.0
    segment = segments(acceleration.size)
    return float(min(np.ptp(acceleration[segment != k]) for k in range(SEGMENTS)))


def segments(size: int) -> NDArray[np.int_]:
    """The segment of each block, (n,)."""
    return np.arange(size) * SEGMENTS // size


def jackknife(X: Array, y: Array) -> tuple[float, float]:
    """First coefficient of the least squares of y (n,) by X (n, k), and its sigma by leaving out each segment.

    Example:
        >>> import numpy as np
        >>> x = np.arange(40.0)
        >>> value, sigma = jackknife(np.column_stack([x, np.ones(40)]), 2 * x + 1)
        >>> round(value, 9), sigma < 1e-9
        (2.0, True)
    """
    scale = np.linalg.norm(X, axis=0)
    scaled = X / np.where(scale > 0, scale, 1.0)

    def first(rows: NDArray[np.bool_]) -> float:
        return float(np.linalg.lstsq(scaled[rows], y[rows], rcond=1e-6)[0][0]) / float(scale[0])

    segment = segments(len(y))
    left_out = np.array([first(segment != k) for k in range(SEGMENTS)])
    sigma = np.sqrt((SEGMENTS - 1) / SEGMENTS * np.sum((left_out - left_out.mean()) ** 2))
    return first(np.ones(len(y), dtype=bool)), float(sigma)


@dataclass(frozen=True, kw_only=True)
class Direction:
    """The turns to one side; value and sigma without the uncertainty of the wheelbase."""

    gradient: tuple[float, float]
    offset: tuple[float, float]
    """Steer angle at no lateral acceleration, rad."""
    by_wheelbase: float
    """Change of the gradient by the wheelbase, rad s^2/m per m."""


def directions(X: Array, steer: Array, curvature: Array) -> dict[str, Direction]:
    """Left and right turns; none if the log does not suffice for both.

    Args:
        X: columns of equation (1), (n, 3): lateral acceleration, its rate, offset.
        steer: steer angle less L times the curvature, (n,), rad.
        curvature: (n,), 1/m.
    """
    found = dict[str, Direction]()
    for name, sign in (("left", 1.0), ("right", -1.0)):
        rows = sign * X[:, 0] > TURNING
        if not suffices(X[rows, 0]):
            return {}
        found[name] = Direction(
            gradient=jackknife(X[rows], steer[rows]),
            offset=jackknife(X[rows][:, ::-1], steer[rows]),
            by_wheelbase=-jackknife(X[rows], curvature[rows])[0],
        )
    return found


def gradients(apart: dict[str, Direction], wheelbase_sigma: float, yaw_rate: str) -> Iterator[EvaluatedMeasure]:
    """The understeer gradients to the left and to the right, and their difference; the sigma of the wheelbase in m."""
    for name, found in apart.items():
        value, sigma = found.gradient
        total = float(np.hypot(sigma, found.by_wheelbase * wheelbase_sigma))
        yield gradient_measure(f"understeer_gradient.{name}", f"understeer gradient, {name}", value, total, yaw_rate)
    if apart:
        (left, sigma_left), (right, sigma_right) = (found.gradient for found in apart.values())
        change = apart["left"].by_wheelbase - apart["right"].by_wheelbase
        sigma = float(np.linalg.norm([sigma_left, sigma_right, change * wheelbase_sigma]))
        differs = abs(left - right) > SIGNIFICANT * sigma
        reason = "significant: uneven steering, load to one side, or the steer angle of one wheel" if differs else ""
        title = "understeer gradient, left less right"
        yield gradient_measure("understeer_gradient.difference", title, left - right, sigma, yaw_rate, reason)


def offset_notes(apart: dict[str, Direction]) -> Iterator[str]:
    """Causes of a steer angle at no lateral acceleration, if it is significant."""
    if not apart:
        return
    (left, sigma_left), (right, sigma_right) = (found.offset for found in apart.values())
    sigma = float(np.hypot(sigma_left, sigma_right))
    if abs(left + right) > SIGNIFICANT * sigma:
        yield (
            f"At no lateral acceleration the steer angle is {with_sigma((left + right) / 2, sigma / 2, 'rad')}: the "
            "offset of its sensor, or the bank of the road. No gradient contains it."
        )
    if left - right > max(SIGNIFICANT * sigma, LEAST_PLAY):
        yield (
            f"At no lateral acceleration the steer angle is larger after turns to the left than to the right by "
            f"{with_sigma(left - right, sigma, 'rad')}: play of the steering, or bends that are banked inwards. The "
            "gradient of both directions contains it; those of one direction do not."
        )


def gradient_measure(
    name: str, title: str, value: float, sigma: float, signal: str, reason: str = ""
) -> EvaluatedMeasure:
    """A gradient over the lateral acceleration, rad s^2/m."""
    return EvaluatedMeasure(name, title, GRADIENT, value, sigma, (signal,), reason)


@dataclass(frozen=True, kw_only=True)
class Blocks:
    """Means over the quasi-steady blocks, (n,)."""

    steer: Array
    speed: Array
    curvature: Array
    acceleration: Array
    rate: Array
    """Of the lateral acceleration, m/s^3."""
    outputs: dict[str, Array]
    linear: NDArray[np.bool_]
    """Up to `LINEAR`."""

    def regressors(self) -> Array:
        """Columns of equation (1), (n, 3): lateral acceleration, its rate, offset."""
        return np.column_stack([self.acceleration, self.rate, np.ones_like(self.rate)])


def evaluate(motion: MeasuredMotion) -> MethodResult:
    """The gradients of a motion.

    Raises:
        SignalError: no yaw rate of the first unit, too little quasi-steady turning, or neither a vehicle nor a sideslip
            or roll angle.
    """
    blocks = _blocks(motion, motion.output(f"yaw_rate.{motion.units[0]}"))
    kind = _kind(blocks)
    measures = [_gradient(blocks, name, values) for name, values in blocks.outputs.items()]
    notes = list(_notes(blocks, kind))
    if motion.vehicle is not None:
        wheelbase = equivalent_wheelbase(motion.vehicle)
        yaw_rate = f"yaw_rate.{motion.units[0]}"
        X, curvature, rows = blocks.regressors(), blocks.curvature, blocks.linear
        apart = directions(X[rows], (blocks.steer - wheelbase[0] * curvature)[rows], curvature[rows])
        measures = [_understeer(blocks, wheelbase, yaw_rate), *gradients(apart, wheelbase[1], yaw_rate), *measures]
        by_scale = approximate(0.01 * abs(_slope(blocks, blocks.steer)[0]), GRADIENT)
        effect = f"changes the understeer gradient by {by_scale}; sigma is without it"
        notes += [f"A scale error of the steer angle of 1 % {effect}.", *offset_notes(apart)]
    elif measures:
        notes.append("Without a vehicle, whose wheelbase it needs, there is no understeer gradient.")
    else:
        raise SignalError("vehicle: needed for the understeer gradient, which needs its wheelbase; give a vehicle file")
    arrays = _arrays(blocks, steady_steer(motion.vehicle)[0] if motion.vehicle else 0.0)
    return MethodResult(
        measures=tuple(measures),
        arrays=arrays,
        noise={name: _scatter(values) for name, values in arrays.items()},
        has_constant_speed=kind == "constant speed",
        notes=tuple(notes),
    )


def _gradient(blocks: Blocks, name: str, values: Array) -> EvaluatedMeasure:
    signal = SignalName.of(name)
    value, sigma = _slope(blocks, values)
    title = f"{signal.quantity} gradient, {named_unit(signal.place)}"
    return gradient_measure(f"{signal.quantity}_gradient.{signal.place}", title, value, sigma, name)


def _notes(blocks: Blocks, kind: str) -> Iterator[str]:
    """What the log is, and what sigma does not contain."""
    used, left = int(blocks.linear.sum()), int((~blocks.linear).sum())
    yield f"Method: {kind}; {used} s of quasi-steady turning up to {LINEAR:g} m/s²."
    if left:
        yield f"{left} s above {LINEAR:g} m/s² are in the diagram, not in the gradients."
    if (fastest := np.abs(blocks.rate).max()) > RECOMMENDED:
        yield (
            f"The lateral acceleration changes by up to {fastest:.2f} m/s² in 1 s; up to {RECOMMENDED:g} is closer to "
            "a steady state."
        )


def _arrays(blocks: Blocks, wheelbase: float) -> dict[str, Array]:
    """The columns of the diagrams in the order of the lateral acceleration; a wheelbase of 0 is unknown."""
    steer = "steer_less_ackermann" if wheelbase else "steer"
    columns = {
        "lateral_acceleration": blocks.acceleration,
        steer: blocks.steer - wheelbase * blocks.curvature,
        **blocks.outputs,
        "speed": blocks.speed,
        "curvature": blocks.curvature,
    }
    order = np.argsort(blocks.acceleration)
    return {name: values[order] for name, values in columns.items()}


def _scatter(values: Array) -> float:
    """Standard deviation of values (n,) from point to point, by second differences, which a smooth curve hardly has."""
    return float(np.median(np.abs(np.diff(values, 2))) / 0.6745 / np.sqrt(6)) if values.size > 4 else float("nan")


def _blocks(motion: MeasuredMotion, yaw_rate: Array) -> Blocks:
    """Means over the blocks whose lateral acceleration is close to that of the blocks before and after."""
    size = round(BLOCK * motion.rate)
    count = len(motion.time) // size

    def mean(values: Array) -> Array:
        return np.asarray(values[: count * size].reshape(count, size).mean(axis=1))

    outputs = {n: mean(v) for q in (SIDESLIP, ROLL) for n, v in motion.outputs(q.quantity).items()}
    outputs = {n: v for n, v in outputs.items() if not n.startswith(SIDESLIP.quantity) or n.endswith(motion.units[0])}
    acceleration = mean(motion.speed * yaw_rate)
    rate = np.gradient(acceleration, size / motion.rate)
    slow = np.abs(np.diff(acceleration)) <= CHANGE
    kept = np.append(slow, True) & np.insert(slow, 0, True)
    columns = {"steer": mean(motion.steer), "speed": mean(motion.speed), "curvature": mean(yaw_rate / motion.speed)}
    columns |= {"acceleration": acceleration, "rate": rate}
    blocks = Blocks(
        **{name: values[kept] for name, values in columns.items()},
        outputs={name: values[kept] for name, values in outputs.items()},
        linear=np.abs(acceleration[kept]) <= LINEAR,
    )
    within = blocks.acceleration[blocks.linear]
    if not suffices(within):
        raise SignalError(
            f"{motion.name}: {within.size} s of quasi-steady motion with a range of lateral acceleration of "
            f"{span(within):.3g} m/s^2 up to {LINEAR:g} m/s^2 without any tenth of it, expected {SEGMENTS + 2} s and "
            f"{SPAN:g} m/s^2; drive circles at several accelerations, or steer slowly, such as the manoeuvre "
            "slowly_increasing_steer"
        )
    return blocks


def _kind(blocks: Blocks) -> str:
    """Which method of the standard the log follows: what is constant while turning, if anything is."""
    turning = np.abs(blocks.acceleration) > 0.25 * np.abs(blocks.acceleration).max()
    quantities = {"constant speed": blocks.speed, "constant radius": blocks.curvature, "constant steer": blocks.steer}
    spreads = {name: np.std(np.abs(v[turning])) / np.mean(np.abs(v[turning])) for name, v in quantities.items()}
    name = min(spreads, key=lambda key: spreads[key])
    return name if spreads[name] < CONSTANT else "mixed driving"


def _understeer(blocks: Blocks, wheelbase: tuple[float, float], yaw_rate: str) -> EvaluatedMeasure:
    """The understeer gradient, with the uncertainty of the wheelbase in its sigma."""
    value, sigma = _slope(blocks, blocks.steer - wheelbase[0] * blocks.curvature)
    by_wheelbase = abs(_slope(blocks, blocks.curvature)[0]) * wheelbase[1]
    total = float(np.hypot(sigma, by_wheelbase))
    remark = f"{percent(by_wheelbase**2 / total**2)} of its variance by the wheelbase" if by_wheelbase > sigma else ""
    return gradient_measure("understeer_gradient", "understeer gradient", value, total, yaw_rate, remark)


def equivalent_wheelbase(vehicle: Vehicle) -> tuple[float, float]:
    """L of `dynamics.steady_steer`, m, and its standard deviation by the vehicle file."""
    trucks = Neighbourhood(Truck(vehicle=vehicle), of_vehicle(vehicle))
    found = samples(trucks, lambda truck: {"L": steady_steer(truck.vehicle)[0]}, sampled=False)
    return found.centre["L"], found.spread(lambda values: values["L"]).sigma or 0.0


def _slope(blocks: Blocks, values: Array) -> tuple[float, float]:
    """Slope over the lateral acceleration in the linear range, and its sigma."""
    return jackknife(blocks.regressors()[blocks.linear], values[blocks.linear])
