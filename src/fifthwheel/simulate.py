"""Logs from the linear model, with the noise of real sensors: for tests, demonstrations and benchmarks."""

from collections.abc import Mapping
from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from fifthwheel import dynamics
from fifthwheel.dynamics import ChainModel, steps
from fifthwheel.errors import SignalError, VehicleError
from fifthwheel.logs import Record
from fifthwheel.logs.noise import article_gyros
from fifthwheel.native import Scan
from fifthwheel.observe.prepare import locked_but
from fifthwheel.vehicle import Vehicle

Array = NDArray[np.float64]

MANOEUVRES = ("lane_changes", "sweep", "random", "straight")

AFTER = 20.0
"""Seconds straight behind every manoeuvre while its steer angles are reckoned."""


@dataclass(frozen=True, kw_only=True)
class LaneChange:
    """One period of a sine of lateral acceleration that moves the first unit's CoG sideways.

    The SAE J2179 lane change by default: 1.464 m in 61 m at 88 km/h, 0.15 g at 0.4 Hz; repeated to the left and to the
    right in turn.
    """

    offset: float = 1.464  # m
    length: float = 61.0  # m
    rest: float = 5.5  # s at least straight after each
    shortest: float = 8.0  # s at least from the start of one to the start of the next
    lead: float = 1.0  # s straight before the first

    def period(self, speed: float) -> float:
        """From the start of one to the start of the next, s."""
        return max(self.shortest, self.length / speed + self.rest)

    def acceleration(self, time: Array, speed: float, count: int) -> Array:
        """Lateral acceleration asked for, m/s^2, (N,)."""
        duration = self.length / speed
        peak = 2 * np.pi * self.offset / duration**2
        wanted = np.zeros_like(time)
        for k in range(count):
            phase = (time - self.lead - k * self.period(speed)) / duration
            wanted += np.where((phase >= 0) & (phase < 1), (-1) ** k * peak * np.sin(2 * np.pi * phase), 0.0)
        return wanted


def steer_for(vehicle: Vehicle, speed: float, time: Array, acceleration: Array, *, roll: bool = True) -> Array:
    """Steer angle (N,), rad, of the first steered axle for a lateral acceleration (N,) of the first unit's CoG.

    The linear model inverted in the frequency domain; `time` is regular. What the steer angle still swings after its
    end dies out in `AFTER` seconds without acceleration, else it would come round to the begin.
    """
    step = float(time[1] - time[0])
    whole = len(time) + round(AFTER / step)
    wanted = np.fft.rfft(acceleration, whole)
    frequency = np.fft.rfftfreq(whole, step)
    m = dynamics.matrices(vehicle, speed, roll=roll)
    response = dynamics.frequency_response(vehicle, speed, frequency, roll=roll)[:, :, 0]
    lateral = m.states.index(f"lateral_velocity.{vehicle.units[0].name}")
    yaw = m.states.index(f"yaw_rate.{vehicle.units[0].name}")
    gain = 2j * np.pi * frequency * response[:, lateral] + speed * response[:, yaw]
    smooth = 1 / (1 + (frequency / 10.0) ** 4)  # a driver has no use for more than 10 Hz
    return np.fft.irfft(wanted / gain * smooth, whole)[: len(time)]


def steer_of(
    manoeuvre: str, vehicle: Vehicle, speed: float, time: Array, *, count: int, seed: int, roll: bool = True
) -> Array:
    """Steer angle (N,), rad, of a manoeuvre of `MANOEUVRES`."""
    if manoeuvre == "straight":
        return np.zeros_like(time)
    if manoeuvre == "lane_changes":
        wanted = LaneChange().acceleration(time, speed, count)
    elif manoeuvre == "sweep":
        low, high = 0.1, 1.5
        phase = 2 * np.pi * (low * time + (high - low) * time**2 / (2 * time[-1]))
        wanted = 1.2 * np.sin(phase) * np.sin(np.pi * time / time[-1]) ** 0.5
    elif manoeuvre == "random":
        spectrum = np.fft.rfft(np.random.default_rng(seed + 1).normal(size=len(time)))
        frequency = np.fft.rfftfreq(len(time), time[1] - time[0])
        wanted = np.fft.irfft(spectrum * ((frequency > 0.05) & (frequency < 1.0)), len(time))
        wanted *= 0.7 / wanted.std()
    else:
        raise SignalError(f"manoeuvre: {manoeuvre!r} is not known; choose one of {', '.join(MANOEUVRES)}")
    return steer_for(vehicle, speed, time, wanted, roll=roll)


def response(
    model: ChainModel, values: Mapping[str, float], time: Array, inputs: Mapping[str, Array], x0: Array | None = None
) -> tuple[Array, Array]:
    """States (N, n) and outputs (N, m) of the model without noise, from x0 (zero by default).

    Args:
        model: with no free parameters.
        values: every parameter of the model by name.
        time: (N,) s.
        inputs: speed and steer angles, (N,) each, in any order.
    """
    columns = steps.stacked(inputs, model.inputs)
    vehicle = model.vehicle.replace({name: values[name] for name in model.vehicle.parameters()})
    limit = steps.longest(vehicle, columns[:, 0], roll=model.roll)
    fine, columns, places = steps.subdivide(time, columns, limit)
    dt, d = steps.step_inputs(fine, columns)
    start = np.zeros(len(model.states)) if x0 is None else x0
    _, out = _simulator(model)(start, np.column_stack([dt, d]), model.known_values(values))
    found = out[places]
    return found[:, : len(model.states)], found[:, len(model.states) :]


_simulators: dict[ChainModel, Scan] = {}


def _simulator(model: ChainModel) -> Scan:
    if model not in _simulators:
        n, k, c = len(model.states), 2 * len(model.inputs), len(model.known)
        x, row, constant = ca.SX.sym("x", n), ca.SX.sym("row", 1 + k), ca.SX.sym("c", c)
        none = ca.SX(0, 1)
        later = model.transition(x, row[0], row[1:], none, constant)
        seen = model.observation(later, row[1:], none, constant)
        step = ca.Function("simulate", [x, row, constant], [later, ca.vertcat(later, seen)], {"cse": True})
        _simulators[model] = Scan(step)
    return _simulators[model]


def simulate(
    vehicle: Vehicle,
    *,
    manoeuvre: str = "lane_changes",
    count: int = 15,
    speed: float = 88 / 3.6,
    rate: float = 100.0,
    duration: float | None = None,
    seed: int = 0,
    sensors: Mapping[str, float] | None = None,
    roll: bool = True,
    name: str = "simulated",
) -> Record:
    """A record of the linear vehicle: what its sensors show, and the true states as reference.

    Args:
        manoeuvre: one of `MANOEUVRES`.
        count: lane changes, left and right in turn.
        speed: m/s, constant.
        rate: samples a second, Hz.
        duration: s; by default as long as the lane changes need, or 60 s.
        seed: of the sensors' noise.
        sensors: variance of the noise by signal; the article's gyros by default.
        roll: simulate yaw and roll, or yaw only.
    """
    if not 5 <= speed <= 40:
        raise SignalError(f"speed: expected 5 to 40 m/s, got {speed:g}; the linear model holds at road speeds")
    if np.linalg.eigvals(dynamics.matrices(vehicle, speed, roll=roll).A).real.max() >= 0:
        raise VehicleError(f"{vehicle.name}: unstable at {speed:.1f} m/s; simulate it below its critical speed")
    lane = LaneChange()
    if duration is None:
        duration = count * lane.period(speed) if manoeuvre == "lane_changes" else 60.0
    time = np.arange(round(duration * rate)) / rate
    first = locked_but(vehicle, vehicle.steer_signals(), vehicle.name).steer_signals()[0]
    steer = steer_of(manoeuvre, vehicle, speed, time, count=count, seed=seed, roll=roll)
    inputs = {n: steer if n == first else np.zeros_like(time) for n in vehicle.steer_signals()}
    inputs["speed"] = np.full_like(time, speed)
    units = [unit.name for unit in vehicle.units]
    sensors = article_gyros(units) if sensors is None else sensors
    sensors = {n: variance for n, variance in sensors.items() if roll or not n.startswith("roll")}
    truth = [f"sideslip.{u}" for u in units] + [f"roll.{u}" for u in units if roll]
    truth += [f"articulation.{u}" for u in units[1:]]
    outputs = (*sensors, *truth)
    model = dynamics.model(vehicle, outputs, roll=roll)
    _, y = response(model, dynamics.all_parameters(vehicle, outputs), time, inputs)
    noise = np.random.default_rng(seed).normal(size=(len(time), len(sensors)))
    measured = {n: y[:, i] + np.sqrt(variance) * noise[:, i] for i, (n, variance) in enumerate(sensors.items())}
    steered = {n: values for n, values in inputs.items() if n in ("speed", first)}
    return Record(
        time=time,
        signals=steered | measured,
        reference={n: y[:, len(sensors) + i] for i, n in enumerate(truth)},
        name=name,
    )
