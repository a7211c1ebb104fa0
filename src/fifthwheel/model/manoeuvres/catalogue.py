"""The catalogue of manoeuvres: their names, and the forms in which each exists.

The linear model is driven by a lateral acceleration or a steer angle over time, the nonlinear plant by a steer angle
over time or by a driver who follows a path.
"""

import inspect
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from fifthwheel.base.arguments import expect_road_speed
from fifthwheel.base.errors import SignalError
from fifthwheel.base.spelling import setting
from fifthwheel.base.types import Array
from fifthwheel.model.manoeuvres import accelerations, courses, open_loops
from fifthwheel.model.manoeuvres.accelerations import inverse_steer
from fifthwheel.model.manoeuvres.courses import (
    Course,
    LaneChange,
    OpenLoop,
    Path,
    braked,
    lane_changes,
    lane_changes_on_test_track,
    require_positive,
)
from fifthwheel.truck import Vehicle


@dataclass(frozen=True, kw_only=True)
class Manoeuvre:
    """A manoeuvre and its forms; None for a form that does not exist."""

    description: str
    acceleration: Callable[..., Array] | None = None
    """Lateral acceleration of the first unit's CoG over time, for the linear model; takes the time (N,)."""
    open_loop: Callable[..., OpenLoop] | None = None
    """Steer angle over time, for the plant, and for the linear model where it has no acceleration; takes the vehicle
    that it is scaled for."""
    path: Callable[..., Path] | None = None
    """Path for a driver, for the plant."""


MANOEUVRES: dict[str, Manoeuvre] = {
    "lane_changes": Manoeuvre(
        description="lane changes of SAE J2179, 1.464 m in 61 m, to the left and to the right in turn",
        acceleration=LaneChange().acceleration,
        path=lane_changes,
    ),
    "test_track": Manoeuvre(
        description="lane changes of 4 m in 30 m, as on the test track of Cheng and Cebon (2011)",
        path=lane_changes_on_test_track,
    ),
    "single_sine": Manoeuvre(description="one period of a sine of the steer angle", open_loop=open_loops.single_sine),
    "step": Manoeuvre(description="step of the steer angle", open_loop=open_loops.step_input),
    "pulse": Manoeuvre(description="pulse of the steer angle, half a sine", open_loop=open_loops.pulse),
    "sine_with_dwell": Manoeuvre(
        description="one period of a sine of the steer angle that stays at its second peak for 1 s",
        open_loop=open_loops.sine_with_dwell,
    ),
    "slowly_increasing_steer": Manoeuvre(
        description="steer angle that rises at a constant rate", open_loop=open_loops.slowly_increasing_steer
    ),
    "sweep": Manoeuvre(
        description="sine with a frequency from 0.1 to 1.5 Hz",
        acceleration=accelerations.sweep,
        open_loop=open_loops.sweep,
    ),
    "random": Manoeuvre(
        description="random steering from 0.05 to 1 Hz",
        acceleration=accelerations.random,
        open_loop=open_loops.random,
    ),
    "straight": Manoeuvre(description="straight ahead", acceleration=np.zeros_like, path=courses.straight),
    "bend": Manoeuvre(
        description="a bend of 8 s with 1 m/s^2, straight before and after it", acceleration=accelerations.bend
    ),
    "constant_radius": Manoeuvre(description="circle of constant radius", path=courses.constant_radius),
    "slow_turns": Manoeuvre(
        description="turns of 90 degrees to the left and to the right, with a radius of 20 m", path=courses.slow_turns
    ),
    "everyday": Manoeuvre(description="random road with bends, lane changes and speed limits", path=courses.everyday),
}
"""Every manoeuvre by its name."""

LINEAR_MANOEUVRES = tuple(name for name, m in MANOEUVRES.items() if m.acceleration or m.open_loop)
"""Names of the manoeuvres of the linear model."""
PLANT_MANOEUVRES = tuple(name for name, m in MANOEUVRES.items() if m.open_loop or m.path)
"""Names of the manoeuvres of the nonlinear plant."""


def linear_course(
    name: str,
    vehicle: Vehicle,
    *,
    speed: float,
    rate: float = 100.0,
    count: int | None = None,
    duration: float | None = None,
    seed: int = 0,
    roll: bool = True,
) -> tuple[Array, Array]:
    """Time (N,), s, and steer angle (N,), rad, of the first steered axle in a manoeuvre of the linear model.

    Args:
        name: one of `LINEAR_MANOEUVRES`.
        vehicle: truck, stable at this speed.
        speed: constant, m/s.
        rate: sampling rate, Hz.
        count: number of lane changes. Default: 15; other manoeuvres do not have it.
        duration: s; by default that of the manoeuvre, or 60 s.
        seed: seed of the random manoeuvre; others do not use it.
        roll: invert the yaw-roll model, or the yaw model.

    Raises:
        SignalError: the manoeuvre is unknown, the linear model does not have it, or it has no `count`.
    """
    manoeuvre = _manoeuvre(name, LINEAR_MANOEUVRES)
    if count is not None and name != "lane_changes":
        raise SignalError(f"count: {name} does not have it, got {count}; leave it out (lane_changes has it)")
    count = 15 if count is None else count
    if manoeuvre.open_loop and not manoeuvre.acceleration:
        given = {} if duration is None else {"duration": duration}
        driven = manoeuvre.open_loop(vehicle, speed=speed, **given)
        time = np.arange(round(driven.duration * rate)) / rate
        return time, np.interp(time, driven.time, driven.steer)
    if duration is None:
        duration = count * LaneChange().period(speed) if name == "lane_changes" else 60.0
    time = np.arange(round(duration * rate)) / rate
    acceleration = acceleration_course(name, time, speed=speed, count=count, seed=seed)
    return time, inverse_steer(vehicle, speed, time, acceleration, roll=roll)


def acceleration_course(name: str, time: Array, *, speed: float, count: int, seed: int) -> Array:
    """Lateral acceleration (N,), m/s^2, of the first unit's CoG in a manoeuvre of the linear model that has one.

    The time (N,) is in equal steps from 0, s, the speed in m/s; lane changes use the count, the random manoeuvre the
    seed. A SignalError if the manoeuvre is unknown, or has no acceleration.
    """
    form = _manoeuvre(name, LINEAR_MANOEUVRES).acceleration
    if form is None:
        option = setting("model", "nonlinear")
        chosen = f" ({option})" if option else ""
        raise SignalError(
            f"manoeuvre: {name!r} exists only for the nonlinear truck{chosen}, or as a steer angle; "
            f"for the linear model choose one of {', '.join(LINEAR_MANOEUVRES)}"
        )
    return form(time, **_accepted(form, {"speed": speed, "count": count, "seed": seed}))


def course(
    name: str,
    vehicle: Vehicle,
    *,
    speed: float | None = None,
    count: int | None = None,
    duration: float | None = None,
    braking: float | None = None,
    seed: int = 0,
) -> Course:
    """The course of a manoeuvre for the nonlinear plant; what is None has the default of the manoeuvre.

    Args:
        name: one of `PLANT_MANOEUVRES`.
        vehicle: truck that an open-loop steer angle is scaled for.
        speed: m/s, 5 to 40; the highest speed for everyday driving.
        count: number of lane changes.
        duration: of the run, s.
        braking: deceleration from 1 s on, m/s^2; see `courses.braked`.
        seed: seed of random manoeuvres; others do not use it.

    Raises:
        SignalError: the manoeuvre is unknown, the plant does not have it, a value is out of range, or the manoeuvre
            does not have an argument that was given.
    """
    manoeuvre = _manoeuvre(name, PLANT_MANOEUVRES)
    form = manoeuvre.path or manoeuvre.open_loop
    if form is None:
        raise SignalError(
            f"manoeuvre: {name!r} exists only for the linear model; for the nonlinear truck choose one of "
            f"{', '.join(PLANT_MANOEUVRES)}"
        )
    if speed is not None:
        expect_road_speed(speed)
    if seed < 0:
        raise SignalError(f"seed: expected 0 or more, got {seed}; give another number")
    options = {"speed": speed, "count": count, "duration": duration}
    given = {key: value for key, value in options.items() if value is not None}
    allowed = _accepted(form, given)
    for key, value in given.items():
        if key not in allowed:
            has = ", ".join(_accepted(form, options)) or "none of them"
            raise SignalError(f"{key}: {name} does not have it, got {value:g}; leave it out ({name} has {has})")
        require_positive(key, value)
    result = form(**_accepted(form, {"vehicle": vehicle, "seed": seed}), **allowed)
    return result if braking is None else braked(result, braking)


def _manoeuvre(name: str, available: Sequence[str]) -> Manoeuvre:
    if name not in MANOEUVRES:
        raise SignalError(f"manoeuvre: {name!r} is not known; choose one of {', '.join(available)}")
    return MANOEUVRES[name]


def _accepted(function: Callable[..., Any], arguments: dict[str, Any]) -> dict[str, Any]:
    """Those of the arguments that the function takes."""
    parameters = inspect.signature(function).parameters
    return {key: value for key, value in arguments.items() if key in parameters}
