"""The single lane change: rearward amplification, transient off-tracking, load transfer ratio.

ISO 14791, single lane change: the front axle follows one period of a sine of lateral acceleration, 0.15 g at 0.4 Hz.
A `LaneChangeRun` holds what the measures need; it comes from the linear model here, or from the nonlinear truck.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fifthwheel.base.types import Array
from fifthwheel.base.units import STANDARD_GRAVITY as GRAVITY
from fifthwheel.model.dynamics import linear_system
from fifthwheel.model.dynamics.state_space import COG_ACCELERATION
from fifthwheel.model.manoeuvres.courses import LaneChange
from fifthwheel.results.assess.measures import DYNAMIC, REAR
from fifthwheel.results.assess.rollover import roll_coupled, rollover
from fifthwheel.results.assess.truck import Series, Truck, Values
from fifthwheel.truck import laden

FREQUENCY, ACCELERATION = 0.4, 0.15 * GRAVITY
"""Of the front axle's lateral acceleration: Hz, m/s^2."""
DURATION, DECAY, STEP = 10.0, 20.0, 0.01
"""Of the run, of the rest that the periodic inverse needs, and from sample to sample, s."""
BAND = np.linspace(0.05, 1.5, 117)
"""Frequencies of the frequency response, Hz."""
CUTOFF = 8.0
"""Highest frequency of the steer angle, Hz."""


@dataclass(frozen=True, kw_only=True)
class LaneChangeRun:
    """A lane change to the left as driven, (N,) samples."""

    time: Array
    """s."""
    steer: Array
    """Road-wheel angle of the first steered axle, rad."""
    acceleration: Series
    """Lateral acceleration, m/s^2: "front", of the front axle, and of the CoG of each unit by name."""
    x: Series
    """Position along the road, m: "front", and the last axle of each unit by name."""
    y: Series
    """Position across the road, m, positive to the left; same names."""
    roll: Series
    """Roll angle of each unit, rad."""
    load_transfer: Array
    """Load transfer ratio of all axle groups but the first."""


def course(speed: float) -> LaneChange:
    """The lane change of `FREQUENCY` and `ACCELERATION` at a speed, m/s."""
    return LaneChange(length=speed / FREQUENCY, offset=ACCELERATION / (2 * np.pi * FREQUENCY**2))


def measure(truck: Truck) -> Values:
    """Measures of the lane change of the linear model, with the rollover threshold of the rearmost units."""
    truck.require_stable()
    run = linear(truck)
    return measures(run) | rear_set(truck, run) | {REAR: rollover(truck)[-1].threshold}


def measure_peak(truck: Truck) -> Values:
    """The largest gain from the lateral acceleration of the first CoG to that of the last, as
    `dynamics.rearward_amplification`; a parabola through the largest gain and its neighbours gives the peak."""
    truck.require_stable()
    if len(truck.vehicle.units) == 1:
        return {}
    ends = [f"{COG_ACCELERATION}.{unit.name}" for unit in (truck.vehicle.units[0], truck.vehicle.units[-1])]
    response = linear_system(truck.vehicle, truck.speed, ends).frequency_response(BAND)[:, :, 0]
    gain = np.abs(response[:, 1] / response[:, 0])
    k = min(max(int(np.argmax(gain)), 1), len(BAND) - 2)
    slope, curvature = (gain[k + 1] - gain[k - 1]) / 2, gain[k + 1] - 2 * gain[k] + gain[k - 1]
    between = gain[k] - slope**2 / (2 * curvature) if curvature < 0 and abs(slope) <= -curvature else 0.0
    return {"rearward_amplification_peak": float(max(gain.max(), between))}


def measures(run: LaneChangeRun) -> Values:
    """Rearward amplification, transient off-tracking, m, load transfer ratio and rollover threshold of a lane change.

    The threshold is the largest lateral acceleration of the front axle over the load transfer ratio: at that
    acceleration all inner wheels behind the first axle group would lift, if the motion grew in proportion. The
    off-tracking is the overshoot of the last axle: its largest y less the largest y of the front axle.
    """
    *others, last = run.roll
    ratio = float(np.max(np.abs(run.load_transfer)))
    values = {"load_transfer_ratio": ratio, DYNAMIC: float(np.max(np.abs(run.acceleration["front"]))) / GRAVITY / ratio}
    if others:
        peak = {name: float(np.max(np.abs(run.acceleration[name]))) for name in ("front", last)}
        values["rearward_amplification"] = peak[last] / peak["front"]
        values["transient_off_tracking"] = float(np.max(run.y[last]) - np.max(run.y["front"]))
    return values


def rear_set(truck: Truck, run: LaneChangeRun) -> Values:
    """Rearward amplification of the rearmost roll-coupled set: the largest of its accelerations, weighted by sprung
    mass times CoG height, sum m h a / sum m h, over the largest of the front axle. A single unit has none."""
    units = [truck.vehicle.units[i] for i in roll_coupled(truck.vehicle)[-1]]
    if len(truck.vehicle.units) == 1:
        return {}
    bodies = {unit.name: laden(truck.vehicle.parameters(), unit) for unit in units}
    weights = {name: body.mass * body.cog_height for name, body in bodies.items()}
    weighted = sum((weight * run.acceleration[name] for name, weight in weights.items()), np.zeros_like(run.time))
    peak = np.max(np.abs(weighted)) / sum(weights.values())
    return {"rearward_amplification_set": float(peak / np.max(np.abs(run.acceleration["front"])))}


def linear(truck: Truck) -> LaneChangeRun:
    """The lane change of the linear model, by its frequency response; the steer angle follows from the front axle."""
    vehicle, speed = truck.vehicle, truck.speed
    names = [unit.name for unit in vehicle.units]
    first = names[0]
    groups = truck.groups()[1:]
    quantities = ("lateral_velocity", "yaw_rate", "roll", "cog_acceleration")
    outputs = [f"{quantity}.{name}" for quantity in quantities for name in names]
    outputs += [f"articulation.{name}" for name in names[1:]]
    outputs += [f"load_transfer_moment.{path}" for *_, path in groups]
    size = round((DURATION + DECAY) / STEP)
    time = STEP * np.arange(size, dtype=np.float64)
    frequency = np.fft.rfftfreq(size, STEP)
    used = frequency <= 2 * CUTOFF
    system = linear_system(vehicle, speed, outputs)
    gains = dict(zip(outputs, system.frequency_response(frequency[used])[:, :, 0].T, strict=True))
    s = 2j * np.pi * frequency[used]
    arm = truck.front_axle.position - vehicle.units[0].cog
    front = gains[f"cog_acceleration.{first}"] + arm * s * gains[f"yaw_rate.{first}"]
    target = np.fft.rfft(course(speed).acceleration(time, speed, 1))[used] / (1 + (frequency[used] / CUTOFF) ** 4)
    steer = target / front

    def signal(spectrum: NDArray[np.complex128]) -> Array:
        padded = np.pad(spectrum, (0, len(frequency) - len(spectrum)))
        return np.asarray(np.fft.irfft(padded, size)[: round(DURATION / STEP)], dtype=np.float64)

    series = {name: signal(gain * steer) for name, gain in gains.items()}
    time = time[: round(DURATION / STEP)]
    heading = _integral(series[f"yaw_rate.{first}"])
    x, y = dict[str, Array](), dict[str, Array]()
    behind = 0.0  # distance from the front axle to the origin of the unit, m, straight ahead
    for i, unit in enumerate(vehicle.units):
        if i:
            coupling = vehicle.couplings[i - 1]
            heading = heading + series[f"articulation.{unit.name}"]
            behind += coupling.leading_position - coupling.trailing_position
        lateral = _integral(speed * heading + series[f"lateral_velocity.{unit.name}"])
        places = {unit.name: min(axle.position for axle in unit.on_road)}
        if not i:
            places["front"], behind = truck.front_axle.position, -truck.front_axle.position
        for name, position in places.items():
            x[name] = speed * time + behind + position
            y[name] = lateral + (position - unit.cog) * heading
    loads = vehicle.axle_loads()
    transferred = sum((np.abs(series[f"load_transfer_moment.{path}"]) for *_, path in groups), np.zeros_like(time))
    return LaneChangeRun(
        time=time,
        steer=signal(steer),
        acceleration={"front": signal(front * steer)} | {n: series[f"cog_acceleration.{n}"] for n in names},
        x=x,
        y=y,
        roll={name: series[f"roll.{name}"] for name in names},
        load_transfer=transferred / (truck.body.half_track * sum(loads[path] for *_, path in groups)),
    )


def _integral(values: Array) -> Array:
    """Integral over time (N,) from 0 by the trapezoidal rule."""
    return np.concatenate([[0.0], np.cumsum((values[1:] + values[:-1]) * STEP / 2)])
