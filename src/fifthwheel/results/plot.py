"""Plots of the linear model: Bode diagram, modes, responses, handling diagram, understeer gradient.

Each function returns a `Plot`, which shows itself in a notebook and has `save`, `to_plotly` and `to_matplotlib`.

Example:
    >>> import fifthwheel as fw
    >>> truck = fw.vehicle("cheng_cebon_2011")
    >>> fw.plot.bode(fw.linear_system(truck, 25.0), ["yaw_rate.tractor", "yaw_rate.semitrailer"])
    Plot('cheng_cebon_2011 at 90 km/h, by steer.tractor.front', 2 panels)
"""

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import ArrayLike

from fifthwheel.base.arguments import expect
from fifthwheel.base.errors import SignalError, VehicleError
from fifthwheel.base.formatting import shown
from fifthwheel.base.plots import Axis, Guide, Item, Line, Panel, Plot, Points
from fifthwheel.base.types import Array
from fifthwheel.base.units import STANDARD_GRAVITY
from fifthwheel.data.record import Record
from fifthwheel.model.dynamics import LinearSystem, critical_speed, linear_system, modes, steady_steer
from fifthwheel.model.manoeuvres import LaneChange, inverse_steer
from fifthwheel.truck import Vehicle

SPEEDS = np.linspace(5.0, 35.0, 61)
"""Default speeds, m/s."""
FREQUENCIES = np.geomspace(0.02, 10.0, 200)
"""Default frequencies, Hz."""
MAX_POINTS = 2000
"""Points of a record in a handling diagram."""
MIN_SPEED = 5.0
"""Slower samples are left out of a handling diagram, m/s."""


def bode(
    system: LinearSystem,
    outputs: str | Sequence[str] | None = None,
    *,
    input: str | None = None,
    frequency: ArrayLike = FREQUENCIES,
) -> Plot:
    """Bode diagram from one input to some outputs of equal unit.

    Args:
        system: from `linear_system`.
        outputs: one or more of its outputs; by default the first.
        input: one of its inputs; by default the first.
        frequency: (f,) Hz.

    Raises:
        SignalError: the system does not have an output or the input, or the outputs have different units.
    """
    expect("system", system, LinearSystem)
    names = _names(outputs if outputs is not None else system.outputs[:1])
    units = {system.units[name] for name in names if system.output_index(name) >= 0}
    if len(units) != 1:
        raise SignalError(
            f"{', '.join(names)}: expected outputs of one unit, got {', '.join(sorted(units))}; plot each"
        )
    steer = _input(system, input)
    f = np.atleast_1d(np.asarray(frequency, dtype=np.float64))
    response = system.frequency_response(f)[:, :, system.input_index(steer)]
    chosen = [response[:, system.output_index(name)] for name in names]
    axis = Axis(label="frequency", unit="Hz", log=True)
    unit = units.pop()
    gains = [Line(f, np.abs(gain), name=name) for name, gain in zip(names, chosen, strict=True)]
    phases = [Line(f, np.degrees(np.unwrap(np.angle(gain)))) for gain in chosen]
    return Plot(
        title=f"{system.vehicle} at {_kmh(system.speed)}, by {steer}",
        panels=[
            Panel(items=gains, x=axis, y=Axis(label="gain", unit=f"{unit} per rad", log=True), height=1.5),
            Panel(items=phases, x=axis, y=Axis(label="phase", unit="deg")),
        ],
    )


def eigenvalues(vehicle: Vehicle, speeds: ArrayLike = SPEEDS, *, roll: bool = True) -> Plot:
    """Natural frequency and damping ratio of all modes against speed, with the critical speed.

    Args:
        vehicle: with its numbers.
        speeds: (s,) m/s.
        roll: use the yaw-roll model, or the yaw model.
    """
    grid = np.atleast_1d(np.asarray(speeds, dtype=np.float64))
    found = [(speed, mode) for speed in grid for mode in modes(vehicle, speed, roll=roll)]
    at = 3.6 * np.array([speed for speed, _ in found])
    frequency = np.array([mode.frequency for _, mode in found])
    damping = np.array([mode.damping for _, mode in found])
    oscillates = np.array([mode.eigenvalue.imag > 0 for _, mode in found])

    def points(values: Array) -> list[Item]:
        return [
            Points(at[chosen], values[chosen], name=name, size=4)
            for chosen, name in ((oscillates, "oscillating"), (~oscillates, "not oscillating"))
            if chosen.any()
        ]

    critical = critical_speed(vehicle, roll=roll, highest=float(grid.max()))
    guides = [] if critical is None else [Guide(x=3.6 * critical, text="critical speed")]
    axis = Axis(label="speed", unit="km/h")
    return Plot(
        title=f"Modes of {vehicle.name}",
        panels=[
            Panel(items=[*points(frequency), *guides], x=axis, y=Axis(label="natural frequency", unit="Hz", log=True)),
            Panel(items=[*points(damping), Guide(y=0.0), *guides], x=axis, y=Axis(label="damping ratio")),
        ],
    )


def step_response(
    system: LinearSystem,
    outputs: str | Sequence[str] | None = None,
    *,
    input: str | None = None,
    steer: float = np.radians(1.0),
    duration: float = 6.0,
) -> Plot:
    """Response to a step of one steer angle, a panel for each output.

    Args:
        system: from `linear_system`.
        outputs: some of its outputs; by default all.
        input: one of its inputs; by default the first.
        steer: height of the step, rad.
        duration: s.

    Raises:
        SignalError: the system does not have an output or the input.
    """
    name, time = _input(system, input), np.linspace(0.0, duration, 1201)
    step = np.full_like(time, steer)
    return _response(
        system,
        _names(outputs if outputs is not None else system.outputs),
        time,
        name,
        step,
        f"Step of {np.degrees(steer):.3g} deg of {name}, {system.vehicle} at {_kmh(system.speed)}",
    )


def lane_change(
    vehicle: Vehicle, speed: float = 88 / 3.6, outputs: Sequence[str] | None = None, *, roll: bool = True
) -> Plot:
    """Response to the lane change of SAE J2179, which the first unit's CoG follows; the steer angle and each output.

    Args:
        vehicle: stable at this speed.
        speed: m/s.
        outputs: as of `linear_system`; by default the accelerations of all units and the sideslip of the last.
        roll: use the yaw-roll model, or the yaw model.

    Raises:
        VehicleError: the vehicle is unstable at this speed.
        SignalError: the model does not have an output.
    """
    units = [unit.name for unit in vehicle.units]
    chosen = [*(f"cog_acceleration.{u}" for u in units), f"sideslip.{units[-1]}"] if outputs is None else outputs
    system = linear_system(vehicle, speed, chosen, roll=roll)
    if system.eigenvalues.real.max() >= 0:
        raise VehicleError(f"{vehicle.name}: unstable at {speed:.1f} m/s; choose a speed below its critical speed")
    time = np.arange(0.0, LaneChange().period(speed) + 3.0, 0.01)
    steer = inverse_steer(vehicle, speed, time, LaneChange().acceleration(time, speed=speed, count=1), roll=roll)
    first = system.inputs[0]
    plot = _response(system, chosen, time, first, steer, f"Lane change, {vehicle.name} at {_kmh(speed)}")
    angle = Panel(items=[Line(time, np.degrees(steer))], title=first, x=plot.panels[0].x, y=Axis(unit="deg"))
    return Plot(title=plot.title, panels=[angle, *plot.panels])


def handling_diagram(
    vehicle: Vehicle, records: Iterable[Record] = (), *, roll: bool = True, largest: float = 0.3
) -> Plot:
    """Handling diagram of the first unit: lateral acceleration against L/R - steer angle (Pacejka 2006, section 1.3).

    The line is the linear model, with L of `dynamics.steady_steer`. Points are the samples of records, with R = speed /
    yaw rate; they lie on the curve of the vehicle where it turns steadily.

    Args:
        vehicle: with its numbers.
        records: with speed, yaw rate of the first unit and the steer angle of its first steered axle.
        roll: use the yaw-roll model, or the yaw model.
        largest: lateral acceleration at the ends of the line, g.

    Raises:
        SignalError: a record does not have one of the signals.
    """
    length, gradient = steady_steer(vehicle, roll=roll)
    acceleration = np.array([-largest, largest])
    line = Line(-np.degrees(gradient * STANDARD_GRAVITY * acceleration), acceleration, name="linear model")
    points = [Points(*_handling_points(vehicle, length, record), name=record.name, size=3) for record in records]
    x, y = Axis(label="L/R - steer angle", unit="deg"), Axis(label="lateral acceleration", unit="g")
    panel = Panel(items=[line, *points, Guide(x=0.0)], x=x, y=y)
    return Plot(title=f"Handling diagram of {vehicle.name}", panels=[panel])


def understeer_gradient(vehicle: Vehicle, *, radius: float = 100.0, roll: bool = True, largest: float = 0.3) -> Plot:
    """Steer angle of the first axle in steady turns of one radius against lateral acceleration (ISO 4138).

    Its slope is the understeer gradient, which the title gives.

    Args:
        vehicle: with its numbers.
        radius: m.
        roll: use the yaw-roll model, or the yaw model.
        largest: largest lateral acceleration, g.
    """
    length, gradient = steady_steer(vehicle, roll=roll)
    acceleration = np.array([0.0, largest])
    steer = np.degrees(length / radius + gradient * STANDARD_GRAVITY * acceleration)
    slope = f"{np.degrees(gradient * STANDARD_GRAVITY):.2f} deg/g"
    panel = Panel(
        items=[Line(acceleration, steer), Guide(y=float(steer[0]), text="neutral")],
        x=Axis(label="lateral acceleration", unit="g"),
        y=Axis(label="steer angle", unit="deg"),
    )
    return Plot(title=f"Understeer gradient {slope}, {vehicle.name}, radius {radius:g} m", panels=[panel])


def _handling_points(vehicle: Vehicle, length: float, record: Record) -> tuple[Array, Array]:
    """L/R - steer angle, deg, and lateral acceleration, g, of the samples of a record (n,)."""
    first = vehicle.units[0].name
    steer, yaw_rate = vehicle.steer_signals()[0], f"yaw_rate.{first}"
    for name in ("speed", steer, yaw_rate):
        if name not in record.signals:
            raise SignalError(f"{name}: not in {record.name}; the handling diagram needs it")
    u, r, delta = (np.asarray(record.signals[name]) for name in ("speed", yaw_rate, steer))
    with np.errstate(invalid="ignore"):
        rows = np.flatnonzero((u > MIN_SPEED) & np.isfinite(r) & np.isfinite(delta))
    rows = rows[:: -(-len(rows) // MAX_POINTS) or 1]
    u, r, delta = u[rows], r[rows], delta[rows]
    return np.degrees(length * r / u - delta), u * r / STANDARD_GRAVITY


def _response(system: LinearSystem, outputs: Sequence[str], time: Array, input: str, steer: Array, title: str) -> Plot:
    """A panel for each output over time."""
    panels: list[Panel] = []
    response = system.response(time, {input: steer})
    for name in outputs:
        system.output_index(name)
        unit = shown(system.units[name])
        items = [Line(time, unit.factor * response[name])]
        panels.append(Panel(items=items, title=name, x=Axis(label="time", unit="s"), y=Axis(unit=unit.name)))
    return Plot(title=title, panels=panels)


def _names(outputs: str | Sequence[str]) -> list[str]:
    return [outputs] if isinstance(outputs, str) else list(outputs)


def _input(system: LinearSystem, name: str | None) -> str:
    return system.inputs[0] if name is None else name


def _kmh(speed: float) -> str:
    return f"{3.6 * speed:.3g} km/h"
