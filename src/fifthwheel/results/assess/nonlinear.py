"""Measures of the nonlinear truck (`fifthwheel.model.plant`), beside those of the linear model.

A driver steers it through the lane change; a pulse of the steer angle and a steady turn follow open loop and on a path.
Its tyres saturate, its axles and springs are in three dimensions; its half track is that of the assessed body.

Static rollover threshold: on a circle the speed rises until a unit rolls over; the road has so much friction that the
truck does not slide before. The threshold is the lateral acceleration speed^2 / radius at the end. The rise is slow, so
that it exceeds the static threshold by about 0.01 g.

Tracking ability on a straight path: the driver holds the front axle on a straight line, on a rough road with a
crossfall. The width between the largest and the smallest lateral position of any corner less that of their means over
time is the part of the roughness.

Stop: the same on a smooth road, on which the truck brakes from 60 km/h with the stated distribution of the brakes and
without anti-lock control. The width from the start of braking on less that before it is the part of the stop. Where
wheels lock the measure is missing, as its sigma would not contain how they slide.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from fifthwheel.base.errors import FifthwheelError, VehicleError
from fifthwheel.base.types import Array
from fifthwheel.base.units import STANDARD_GRAVITY
from fifthwheel.model.manoeuvres import Course, OpenLoop, Path, constant_radius, straight
from fifthwheel.model.plant import Plant, Properties
from fifthwheel.results.assess import lane_change, longitudinal, rollover, steady_motion, yaw_damping
from fifthwheel.results.assess.lane_change import LaneChangeRun
from fifthwheel.results.assess.measures import STOP, STRAIGHT, TRACKING, title
from fifthwheel.results.assess.truck import Series, Truck, Values
from fifthwheel.truck import Unit
from fifthwheel.truck.spoken_names import named_axle

RATE = 100.0
"""Of the samples, Hz."""
TURN = 30.0
"""Duration of the steady turn, s."""
PULSE = np.radians(2.0)
"""Steer angle of the pulse, rad."""
ROLLOVER_RADIUS, ROLLOVER_RATE, GRIP = 150.0, 0.005, 3.0
"""Of the turn with rising speed: radius, m, rate of the lateral acceleration, g/s, factor on the friction."""
ROLLOVER_RANGE = (0.75, 1.35)
"""Lateral acceleration of that turn as a fraction of the threshold of the linear springs."""
ROUGHNESS, TRACKING_SPEED, TRACKING_LENGTH, SETTLED = 48.9e-6, 90 / 3.6, 1000.0, 10.0
"""Of the rough road: G_d(n_0) of ISO 8608 for an international roughness index of 3.8 m/km, m^3; speed, m/s; length, m;
time before it, s."""
STOP_SPEED, STOPPED, SLOWEST, STOP_TIME = 60 / 3.6, 10 / 3.6, 2.5, 8.0
"""Of the stop: speeds at which it begins and ends, and lowest speed that the driver demands, m/s, as the tyre model
needs 1 m/s; longest duration, s. From 26 km/h on the deceleration falls."""
CONTROLLER_LAG = 1.25
"""Time by which the truck lags behind the demanded speed, s."""


def measures(truck: Truck) -> tuple[Values, dict[str, LaneChangeRun], tuple[str, ...]]:
    """Measures of the nonlinear truck, its lane change, and the reasons why some are missing, such as MuJoCo."""
    runs, values, notes = dict[str, LaneChangeRun](), Values(), list[str]()
    try:
        plant = Plant(truck.vehicle, Properties(half_track=truck.body.half_track))
        plant.multibody  # noqa: B018 - compiles it, or refuses it
    except FifthwheelError as error:
        return values, runs, (f"nonlinear truck: {error}",)

    def changed_lanes() -> Values:
        runs["nonlinear"] = run = drive_lane_change(truck, plant)
        return lane_change.measures(run) | lane_change.rear_set(truck, run)

    def stopped() -> Values:
        found, locked = stop(truck)
        if not locked:
            return found
        notes.append(
            f"Not assessed: {title(STOP)}; without anti-lock control wheels lock, in this order:"
            f" {', '.join(map(named_axle, locked))}; the nonlinear truck then sweeps {found[STOP]:.1f} m"
        )
        return {}

    manoeuvres: dict[str, Callable[[], Values]] = {
        "lane change": changed_lanes,
        "pulse": lambda: {"yaw_damping_pulse": yaw_damping.pulse_damping(*pulse(truck, plant))},
        "steady turn": lambda: {"steady_off_tracking": steady_off_tracking(truck, plant)},
        "rollover": lambda: rollover_threshold(truck),
        "stop": stopped,
        "rough road": lambda: straight_path(truck),
    }
    for name, driven in manoeuvres.items():
        try:
            values |= driven()
        except FifthwheelError as error:
            notes.append(f"nonlinear truck, {name}: {error}")
    return values, runs, tuple(notes)


def rollover_threshold(truck: Truck) -> Values:
    """The threshold, g, of the truck and of the roll-coupled set of units that rolls over first.

    Raises:
        VehicleError: no unit rolls over in `ROLLOVER_RANGE`.
    """
    sets = rollover.rollover(truck)
    low, high = (fraction * min(s.threshold for s in sets) for fraction in ROLLOVER_RANGE)
    start, end = (np.sqrt(a * STANDARD_GRAVITY * ROLLOVER_RADIUS) for a in (low, high))
    rise = (high - low) / ROLLOVER_RATE  # s
    entry = 2.0 + start**2 / ROLLOVER_RADIUS  # straight ahead, and the clothoid, s
    course = constant_radius(
        radius=ROLLOVER_RADIUS, speed=start, acceleration=(end - start) / rise, duration=entry + rise
    )
    plant = Plant(truck.vehicle, Properties(half_track=truck.body.half_track, friction=GRIP))
    run = plant.drive(course, rate=RATE, until_rollover=True)
    if run.time[-1] > course.duration - 1:
        raise VehicleError(f"{truck.vehicle.name}: does not roll over up to {high:.2f} g")
    threshold = float(run.truth["speed"][-1] ** 2 / ROLLOVER_RADIUS / STANDARD_GRAVITY)
    first = max(sets, key=lambda s: max(abs(run.truth[f"roll.{name}"][-1]) for name in s.units))
    return {"rollover_threshold": threshold, rollover.set_name(first): threshold}


def drive_lane_change(truck: Truck, plant: Plant) -> LaneChangeRun:
    """The lane change, which the driver steers the front axle along."""
    course = lane_change.course(truck.speed).path(count=1, speed=truck.speed)
    truth = _drive(plant, course)
    units = truck.vehicle.units
    groups = truck.groups()[1:]
    axles = [f"{unit.name}.{axle.name}" for _, unit, group, _ in groups for axle in group.on_road]
    load = [truth[f"vertical_force.{axle}"] for axle in axles]
    transferred = [np.abs(truth[f"load_transfer.{axle}"] * force) for axle, force in zip(axles, load, strict=True)]
    front = units[0].name
    arm = truck.front_axle.position - units[0].cog
    acceleration = {unit.name: _acceleration(truth, unit) for unit in units}
    yaw_acceleration = np.gradient(truth[f"yaw_rate.{front}"], 1 / RATE)
    places = {unit.name: (unit, min(axle.position for axle in unit.on_road)) for unit in units}
    places["front"] = units[0], truck.front_axle.position
    positions = {name: _position(truth, unit, x) for name, (unit, x) in places.items()}
    return LaneChangeRun(
        time=truth["time"],
        steer=truth[truck.vehicle.steer_signals()[0]],
        acceleration=acceleration | {"front": acceleration[front] + arm * yaw_acceleration},
        x={name: p.real - positions["front"].real[0] for name, p in positions.items()},
        y={name: p.imag for name, p in positions.items()},
        roll={unit.name: truth[f"roll.{unit.name}"] for unit in units},
        load_transfer=np.sum(transferred, axis=0) / np.sum(load, axis=0),
    )


def pulse(truck: Truck, plant: Plant) -> tuple[Array, Array]:
    """Time and last articulation angle, rad, (yaw rate of a single unit, rad/s) after a pulse of `PULSE`, (N,)."""
    units = truck.vehicle.units
    output = f"articulation.{units[-1].name}" if len(units) > 1 else f"yaw_rate.{units[0].name}"
    time = np.arange(0.0, yaw_damping.DURATION, 1 / RATE)
    half_sine = np.where(time < yaw_damping.PULSE, np.sin(np.pi * time / yaw_damping.PULSE), 0.0)
    speed = np.full_like(time, truck.speed)
    truth = _drive(plant, OpenLoop(time=time, steer=PULSE * half_sine, speed=speed, name="pulse"))
    return truth["time"], truth[output] - truth[output][-1]


def steady_off_tracking(truck: Truck, plant: Plant) -> float:
    """Off-tracking of the last axle in a steady turn to the left, m; positive outside.

    Circles about the centre of the first unit's motion in the last second, as in `steady_motion`.
    """
    radius = truck.speed**2 / steady_motion.ACCELERATION
    truth = _drive(plant, constant_radius(radius=radius, speed=truck.speed, duration=TURN))
    units, last = truck.vehicle.units, slice(-round(RATE), None)
    first = units[0]
    truth = {name: values[last] for name, values in truth.items()}
    rate = truth[f"yaw_rate.{first.name}"]
    forward, across = (truth[f"{q}_velocity.{first.name}"] for q in ("longitudinal", "lateral"))
    centre = _position(truth, first, first.cog) + np.exp(1j * truth[f"yaw.{first.name}"]) * 1j * (
        (forward + 1j * across) / rate
    )
    outer = np.abs(_position(truth, units[-1], truck.rear_axle.position) - centre)
    return float(np.mean(outer - np.abs(_position(truth, first, truck.front_axle.position) - centre)))


def straight_path(truck: Truck, seed: int = 0) -> Values:
    """Swept widths on a straight road with a crossfall, m: of the mean positions, and on the rough road of a seed."""
    course = straight(speed=TRACKING_SPEED, duration=SETTLED + TRACKING_LENGTH / TRACKING_SPEED)
    truth = _on_crossfall(truck, roughness=ROUGHNESS).drive(course, rate=RATE, seed=seed).truth
    y, width = lateral_positions(truck, truth)[:, round(SETTLED * RATE) :], truck.body.width
    return {STRAIGHT: float(np.ptp(y.mean(axis=1))) + width, TRACKING: float(np.ptp(y)) + width}


def stop(truck: Truck, friction: float = 1.0) -> tuple[Values, tuple[str, ...]]:
    """Swept widths before and in a stop on the crossfall, m, and the axle groups whose wheels lock, in this order.

    A wheel locks where it turns at less than half the speed of the truck. `friction` as in `Properties`.
    """
    truth = _drive(_on_crossfall(truck, friction=friction, brakes=truck.body.brakes), stop_course())
    start, slow = round(SETTLED * RATE), truth["speed"] < STOPPED
    during = slice(start, int(slow.argmax()) if slow.any() else None)
    y, width = lateral_positions(truck, truth), truck.body.width
    half = truth["speed"][during] / 2
    locks = {
        path: np.any([truth[wheel][during] < half for wheel in truth if wheel.startswith(axles)], axis=0)
        for _, unit, group, path in truck.groups()
        if (axles := tuple(f"wheel_speed.{unit.name}.{axle.name}." for axle in group.on_road))
    }
    locked = sorted((path for path in locks if locks[path].any()), key=lambda path: int(locks[path].argmax()))
    return {STRAIGHT: float(np.ptp(y[:, start])) + width, STOP: float(np.ptp(y[:, during])) + width}, tuple(locked)


def stop_course() -> Path:
    """A straight path of which the demanded speed falls after `SETTLED`, so that the truck decelerates at once."""
    deceleration = longitudinal.DECELERATION * STANDARD_GRAVITY
    course = straight(speed=STOP_SPEED, duration=SETTLED + STOP_TIME)
    distance = np.maximum(course.arc - STOP_SPEED * SETTLED, 0.0)
    demanded = np.sqrt(np.maximum(STOP_SPEED**2 - 2 * deceleration * distance, 0.0))
    demanded -= CONTROLLER_LAG * deceleration * (distance > 0)
    return replace(course, speed=np.maximum(demanded, SLOWEST))


def _on_crossfall(truck: Truck, **properties: Any) -> Plant:
    return Plant(
        truck.vehicle, Properties(half_track=truck.body.half_track, bank=steady_motion.CROSSFALL, **properties)
    )


def lateral_positions(truck: Truck, truth: Series) -> Array:
    """Lateral position of the front and rear end of the centre line of every unit, m, (2 n, N)."""
    ends = zip(truck.vehicle.units, truck.ends(), strict=True)
    return np.array([_position(truth, unit, x).imag for unit, (rear, front) in ends for x in (front, rear)])


def _drive(plant: Plant, course: Course) -> Series:
    """True signals of a run by name, with "time"."""
    run = plant.drive(course, rate=RATE)
    return run.truth | {"time": run.time}


def _position(truth: Series, unit: Unit, x: float) -> Array:
    """Position of a point on the centre line of a unit at the height of its roll axis, (N,) complex, m."""
    axis = np.exp(1j * truth[f"yaw.{unit.name}"])
    return np.asarray(truth[f"position_x.{unit.name}"] + 1j * truth[f"position_y.{unit.name}"] + (x - unit.cog) * axis)


def _acceleration(truth: Series, unit: Unit) -> Array:
    """Lateral acceleration of the point under the CoG of a unit, without gravity, (N,) m/s^2."""
    across, forward = (truth[f"{q}_velocity.{unit.name}"] for q in ("lateral", "longitudinal"))
    return np.gradient(across, 1 / RATE) + forward * truth[f"yaw_rate.{unit.name}"]
