"""Corruptions of a log, of its run and of the vehicle file, in one table: `CORRUPTIONS`.

Each corruption has the words of its cause: a message that contains one of them names the cause. Angles are in degrees
in this table and in its names; everything else is in SI.
"""

import math
import zlib
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial, reduce
from typing import Any

import numpy as np

from fifthwheel.base.names import ParameterPath
from fifthwheel.base.types import Array
from fifthwheel.data.channels import SignalName
from fifthwheel.data.record import Record
from fifthwheel.data.record.derived import article_gyro_variance
from fifthwheel.model import dynamics
from fifthwheel.model.dynamics.simulation import free_response
from fifthwheel.model.dynamics.unit_equations import BANK
from fifthwheel.truck import Vehicle
from trust_runs import TRUCK, Changes

SPEED, STEER = "speed", "steer.tractor.front"
YAW, YAW2, ROLL, ROLL2 = GYROS = (
    "yaw_rate.tractor",
    "yaw_rate.semitrailer",
    "roll_rate.tractor",
    "roll_rate.semitrailer",
)
TRAILER, EVERY = (YAW2, ROLL2), (SPEED, STEER, *GYROS)
TRACTOR_UNIT, TRAILER_UNIT = "tractor", "semitrailer"
NOISE = {name: math.sqrt(variance) for name, variance in article_gyro_variance((TRACTOR_UNIT, TRAILER_UNIT)).items()}
"""Standard deviation of the noise of each gyro of the uncorrupted log, rad/s."""
DEGREE = math.radians(1)

OfRecord = Callable[[Record], Record]
OfVehicle = Callable[[Vehicle], Vehicle]
OfSignal = Callable[[Array, Array], Array]
"""Time and values to other values."""


def unchanged(data: Any) -> Any:
    return data


@dataclass(frozen=True, kw_only=True)
class Corruption:
    """One fault, and how to recognise that a message names it."""

    name: str
    category: str
    words: tuple[str, ...]
    """A message names the cause if it contains one of them."""
    record: OfRecord = unchanged
    vehicle: OfVehicle = unchanged
    runs: tuple[Changes, ...] = ((),)
    """Changed properties of the nonlinear truck, for each log."""


# Records


def changed(names: Iterable[str], change: OfSignal, record: Record) -> Record:
    """The record with some of its signals changed."""
    return record.with_signals({name: change(record.time, record.signals[name]) for name in names})


def on(names: str | Iterable[str], change: OfSignal) -> OfRecord:
    """The change of one or several signals."""
    return partial(changed, (names,) if isinstance(names, str) else tuple(names), change)


def random(*key: object) -> np.random.Generator:
    """A generator that depends on the key only."""
    return np.random.default_rng(zlib.crc32(repr(key).encode()))


def late(seconds: float) -> OfSignal:
    return lambda time, values: np.interp(time - seconds, time, values)


def jittered(seconds: float) -> OfSignal:
    def change(time: Array, values: Array) -> Array:
        return np.interp(time + random("jitter", values[0]).uniform(-seconds, seconds, len(time)), time, values)

    return change


def repeated(fraction: float) -> OfSignal:
    """Dropped samples, each replaced by the last sample before it."""

    def change(time: Array, values: Array) -> Array:
        dropped = random("repeated", values[0]).random(len(time)) < fraction
        dropped[0] = False
        return np.asarray(values[np.maximum.accumulate(np.where(dropped, 0, np.arange(len(time))))])

    return change


def sampled_at(rate: float) -> OfSignal:
    """Sample and hold at a rate, Hz."""

    def change(time: Array, values: Array) -> Array:
        ticks = np.floor((time - time[0]) * rate + 1e-6)
        return np.asarray(values[np.searchsorted(ticks, ticks)])

    return change


def gained(factor: float, bias: float = 0.0) -> OfSignal:
    return lambda time, values: factor * values + bias


def drifting(size: float) -> OfSignal:
    """A bias that increases from 0 to its size along the log."""
    return lambda time, values: values + size * (time - time[0]) / (time[-1] - time[0])


def noisy(sigma: float) -> OfSignal:
    return lambda time, values: values + random("noise", values[0]).normal(0, sigma, len(time))


def quantised(step: float) -> OfSignal:
    return lambda time, values: step * np.round(values / step)


def spiked(size: float) -> OfSignal:
    """Single samples off by the size, 1 % of all."""

    def change(time: Array, values: Array) -> Array:
        generator = random("spikes", values[0])
        return values + size * generator.choice([-1, 0, 1], len(time), p=[0.005, 0.99, 0.005])

    return change


def burst(sigma: float) -> OfSignal:
    """Noise in a tenth of the log."""

    def change(time: Array, values: Array) -> Array:
        noise = random("burst", values[0]).normal(0, sigma, len(time))
        return values + np.where(within(time, 0.45, 0.55), noise, 0)

    return change


def stuck(start: float, stop: float) -> OfSignal:
    """A constant value between two fractions of the log."""

    def change(time: Array, values: Array) -> Array:
        inside = within(time, start, stop)
        return np.where(inside, values[inside.argmax()], values)

    return change


def missing(start: float, stop: float) -> OfSignal:
    return lambda time, values: np.where(within(time, start, stop), np.nan, values)


def within(time: Array, start: float, stop: float) -> Array:
    """(N,) True between two fractions of the log."""
    fraction = (time - time[0]) / (time[-1] - time[0])
    return np.asarray((fraction >= start) & (fraction < stop))


def saturated(limit: float) -> OfSignal:
    return lambda time, values: np.clip(values, -limit, limit)


def low_passed(cutoff: float) -> OfSignal:
    """A first-order low-pass filter, Hz."""

    def change(time: Array, values: Array) -> Array:
        pole = math.exp(-2 * math.pi * cutoff * float(np.median(np.diff(time))))
        filtered = values.copy()
        for k in range(1, len(values)):
            filtered[k] = pole * filtered[k - 1] + (1 - pole) * values[k]
        return filtered

    return change


def steering_play(width: float) -> OfSignal:
    """Play between the steering sensor and the road wheels: the sensor leads the wheels by half of it."""

    def change(time: Array, values: Array) -> Array:
        rate = np.gradient(values, time)
        turning = np.abs(rate) > 0.02 * np.abs(rate).max()
        last = np.maximum.accumulate(np.where(turning, np.arange(len(time)), 0))
        side = np.where(turning.cumsum() > 0, np.sign(rate[last]), 0)
        window = max(round(0.1 / float(np.median(np.diff(time)))), 1)  # the sensor crosses the play in 0.1 s
        return np.asarray(values + width / 2 * np.convolve(side, np.ones(window) / window, mode="same"))

    return change


def wind_compensated(sigma: float) -> OfSignal:
    """A steer angle that compensates the yaw moment of side wind: the truck does not turn by it."""

    def change(time: Array, values: Array) -> Array:
        step = float(np.median(np.diff(time)))
        wind = low_passed(0.2)(time, random("wind", len(time)).normal(0, 1, len(time)))
        return values + sigma * wind / max(float(wind.std()), step)

    return change


def exchanged(one: str, other: str) -> OfRecord:
    return lambda record: record.with_signals({one: record.signals[other], other: record.signals[one]})


def replaced(name: str, by: str) -> OfRecord:
    return lambda record: record.with_signals({name: record.signals[by]})


def time_base(factor: float) -> OfRecord:
    return lambda record: replace(record, time=record.time * factor)


def tilted(angles: Mapping[str, float]) -> OfRecord:
    """Gyros rotated about the lateral axis of their unit by angles in degrees; see `model.plant.sensors.Sensor`."""

    def inject(record: Record) -> Record:
        signals = {}
        for name, angle in angles.items():
            signal = SignalName.of(name)
            other, sign = ("roll_rate", 1) if signal.quantity == "yaw_rate" else ("yaw_rate", -1)
            c, s = math.cos(angle * DEGREE), sign * math.sin(angle * DEGREE)
            signals[name] = c * record.signals[name] + s * record.signals[f"{other}.{signal.unit}"]
        return record.with_signals(signals)

    return inject


def with_bank(amplitude: float, period: float) -> OfRecord:
    """The record with the linear response to a bank that changes like a sine, and the rotation of the road itself."""

    def inject(record: Record) -> Record:
        truck = TRUCK.with_logged_steering(record.signals, record.name)
        model = dynamics.model(truck, GYROS, roll=True, bank=True)
        values, start = dynamics.all_parameters(truck, GYROS), np.zeros(len(model.states))
        start[model.states.index(BANK)] = 1.0
        inputs = {STEER: np.zeros(len(record)), SPEED: np.full(len(record), record.signals[SPEED].mean())}
        _, step_response = free_response(model, values, record.time, inputs, start)
        bank = amplitude * np.sin(2 * np.pi * (record.time - record.time[0]) / period)
        rate = np.gradient(bank, record.time)
        signals = {}
        for i, name in enumerate(GYROS):
            response = np.convolve(np.diff(bank, prepend=0.0), step_response[:, i])[: len(record)]
            signals[name] = record.signals[name] + response + (rate if name in (ROLL, ROLL2) else 0)
        return record.with_signals(signals)

    return inject


# Vehicle files


def scaled(factor: float, *ends: str, unit: str = "") -> OfVehicle:
    """All parameters with one of these ends, of one unit if given, multiplied by a factor."""

    def change(vehicle: Vehicle) -> Vehicle:
        paths = [p for p in vehicle.parameters() if p.endswith(ends) and (not unit or ParameterPath.of(p).unit == unit)]
        return vehicle.replace({path: factor * vehicle.parameters()[path] for path in paths})

    return change


def shifted(path: str, by: float) -> OfVehicle:
    return lambda vehicle: vehicle.replace({path: vehicle.parameters()[path] + by})


def with_payload(factor: float, *, same_mass: bool) -> OfVehicle:
    """Another payload mass; the mass of the unit stays, or changes by the same kilograms."""

    def change(vehicle: Vehicle) -> Vehicle:
        p = vehicle.parameters()
        payload, body, unit = (f"{TRAILER_UNIT}.{key}" for key in ("payload.mass", "sprung.mass", "mass"))
        change = (factor - 1) * p[payload]
        other = {body: p[body] - change} if same_mass else {unit: p[unit] + change}
        return vehicle.replace({payload: p[payload] + change, **other})

    return change


def all_of(*changes: OfVehicle) -> OfVehicle:
    return lambda vehicle: reduce(lambda truck, change: change(truck), changes, vehicle)


# The table

TIME_WORDS = ("time base", "delay", "latency")
MASS_WORDS = ("mass", "weigh")
GEOMETRY_WORDS = ("axle position", "_position", ".position", "wheelbase", ".cog is")
ROLL_WORDS = ("roll_stiffness", "roll stiffness", "roll_axis", "roll_damping", "cog_height", "roll_inertia")
"""Words of wrong vehicle files. "Vehicle file" alone names no cause: many messages contain it."""
LEVELS = {"yaw_rate": 0.3, "roll_rate": 0.6, "steer": 0.05, "speed": 5.0}
"""Size of a spike or burst in SI by quantity."""


def time_bases() -> Iterator[Corruption]:
    def case(name: str, names: str | Iterable[str], change: OfSignal) -> Corruption:
        signals = (names,) if isinstance(names, str) else tuple(names)
        words = words_of(signals) if len(signals) < len(EVERY) else ("sampling", "timestamp", "repeated")
        return Corruption(name=name, category="time base", words=(*TIME_WORDS, *words), record=on(names, change))

    yield from (case(f"trailer gyros {s:g} s late", TRAILER, late(s)) for s in (0.02, 0.05, 0.1, 0.35, 1.0))
    for name in GYROS:
        yield from (case(f"{name} {s:g} s late", name, late(s)) for s in (0.02, 0.05, 0.1))
    yield from (case(f"all gyros {s:g} s late", GYROS, late(s)) for s in (0.05, 0.1, 0.2))
    yield from (case(f"steer {s:g} s late", STEER, late(s)) for s in (0.02, 0.05, 0.1, 0.2))
    yield from (case(f"steer {s:g} s early", STEER, late(-s)) for s in (0.02, 0.05, 0.1))
    yield from (case(f"speed {s:g} s late", SPEED, late(s)) for s in (0.2, 0.5, 1.0))
    for factor in (0.95, 0.98, 0.99, 1.01, 1.02, 1.05):
        yield Corruption(
            name=f"time x {factor:g}", category="time base", words=("time base", "sampling"), record=time_base(factor)
        )
    yield from (case(f"jitter {s:g} s", EVERY, jittered(s)) for s in (0.005, 0.02))
    yield from (case(f"{f:.0%} of samples repeated", EVERY, repeated(f)) for f in (0.05, 0.2))
    yield from (case(f"all signals held at {r:g} Hz", EVERY, sampled_at(r)) for r in (10, 20))
    yield from (case(f"steer held at {r:g} Hz", STEER, sampled_at(r)) for r in (10, 20))
    yield from (case(f"trailer gyros held at {r:g} Hz", TRAILER, sampled_at(r)) for r in (10, 20))


def gains() -> Iterator[Corruption]:
    factors = {STEER: (0.8, 0.9, 0.95, 1.05, 1.1, 1.2, 1.3), SPEED: (0.95, 0.98, 1.02, 1.05, 1.1)}
    for name in (STEER, SPEED, *GYROS):
        for factor in factors.get(name, (0.9, 0.95, 1.05, 1.1, 1.5, 2.0)):
            yield of_signal("gain", f"{name} x {factor:g}", name, gained(factor))


def biases() -> Iterator[Corruption]:
    for name in GYROS:
        for bias in (0.1, 0.3, 1.0):
            yield of_signal("bias", f"{name} {bias:+g} deg/s", name, gained(1, bias * DEGREE))
        yield of_signal("bias", f"{name} drifts by 0.5 deg/s", name, drifting(0.5 * DEGREE))
    for bias in (0.2, 0.5, 1.0, 2.0):
        yield of_signal("bias", f"steer {bias:+g} deg", STEER, gained(1, bias * DEGREE))
    yield of_signal("bias", "steer drifts by 0.3 deg", STEER, drifting(0.3 * DEGREE))


def noise() -> Iterator[Corruption]:
    for name, sigma in NOISE.items():
        for factor in (3, 10):
            yield of_signal("noise", f"noise of {name} x {factor}", name, noisy(math.sqrt(factor**2 - 1) * sigma))
    yield from (of_signal("noise", f"steer noise {s:g} deg", STEER, noisy(s * DEGREE)) for s in (0.05, 0.2))
    yield from (of_signal("noise", f"speed noise {s:g} m/s", SPEED, noisy(s)) for s in (0.1, 0.5))
    for name in (YAW, YAW2, STEER):
        for step in (0.1, 0.5):
            yield of_signal("noise", f"{name} in steps of {step:g} deg", name, quantised(step * DEGREE))
    yield of_signal("noise", "speed in steps of 1 km/h", SPEED, quantised(1 / 3.6))
    for name in EVERY:
        level = LEVELS[SignalName.of(name).quantity]
        yield of_signal("noise", f"spikes in {name}", name, spiked(level))
        yield of_signal("noise", f"burst in {name}", name, burst(level / 3))


def faults() -> Iterator[Corruption]:
    for name in EVERY:
        yield of_signal("fault", f"{name} stuck in the middle", name, stuck(0.4, 0.6))
        yield of_signal("fault", f"{name} missing in the middle", name, missing(0.45, 0.5))
        yield of_signal("fault", f"{name} sign inverted", name, gained(-1))
    for name in GYROS:
        yield from (of_signal("fault", f"{name} saturated at {x:g} deg/s", name, saturated(x * DEGREE)) for x in (3, 5))
    for one, other in ((ROLL2, ROLL), (YAW2, YAW), (YAW, YAW2)):
        yield Corruption(name=f"{one} is {other}", category="fault", words=(one, other), record=replaced(one, other))
    for one, other in ((ROLL, ROLL2), (YAW, YAW2), (YAW, ROLL), (YAW2, ROLL2)):
        name = f"{one} and {other} exchanged"
        yield Corruption(name=name, category="fault", words=(one, other), record=exchanged(one, other))
    for cutoff in (1, 2, 5):
        for name in (STEER, *GYROS):
            yield of_signal("filter", f"{name} filtered at {cutoff} Hz", name, low_passed(cutoff), *TIME_WORDS)
        words = (*GYROS, *TIME_WORDS, "filter")
        change = on(GYROS, low_passed(cutoff))
        yield Corruption(name=f"all gyros filtered at {cutoff} Hz", category="filter", words=words, record=change)


def mounting() -> Iterator[Corruption]:
    for label, gyros in {"all gyros": GYROS, "tractor gyros": (YAW, ROLL), "trailer gyros": TRAILER}.items():
        for angle in (2, 5, 10):
            change, words = tilted(dict.fromkeys(gyros, angle)), gyros
            yield Corruption(name=f"{label} tilted {angle} deg", category="mounting", words=words, record=change)
    for name in GYROS:
        for angle in (-5, 5, 10):
            change, words = tilted({name: angle}), (name,)
            yield Corruption(name=f"{name} tilted {angle} deg", category="mounting", words=words, record=change)


def steering_and_road() -> Iterator[Corruption]:
    category = "steering and road"
    for width in (0.1, 0.3, 0.5, 1.0):
        name = f"steering play {width:g} deg"
        yield of_signal(category, name, STEER, steering_play(width * DEGREE), "free play", *TIME_WORDS)
    for sigma in (0.02, 0.1, 0.3):
        yield of_signal(category, f"side wind, {sigma:g} deg of steer", STEER, wind_compensated(sigma * DEGREE), "wind")
    for angle in (-2, 1, 2, 4):
        runs = ((("bank", angle * DEGREE),),)
        yield Corruption(name=f"bank {angle} deg", category=category, words=("bank",), runs=runs)
    for amplitude, period in ((1, 60), (2, 20), (2, 60)):
        name, change = f"bank +-{amplitude} deg in {period} s", with_bank(amplitude * DEGREE, period)
        yield Corruption(name=name, category=category, words=("bank",), record=change)
    for friction in (0.3, 0.5):
        runs = ((("friction", friction),),)
        yield Corruption(name=f"friction {friction:g}", category=category, words=("linear", "friction"), runs=runs)
    for stiffness in (0.9, 0.8):
        two = ((), (("stiffness", stiffness),))
        name = f"tyres x {stiffness:g} in a second log"
        yield Corruption(name=name, category=category, words=("logs differ", "between logs"), runs=two)


def masses() -> Iterator[Corruption]:
    for unit in ("", TRACTOR_UNIT, TRAILER_UNIT):
        for factor in (0.7, 0.9, 0.95, 1.05, 1.1, 1.3):
            change = scaled(factor, ".mass", unit=unit)
            yield of_file("mass", f"masses of {unit or 'all units'} x {factor:g}", change, MASS_WORDS)
    for factor in (0.5, 0.8):
        for same in (True, False):
            name = f"payload mass x {factor:g}, {'same' if same else 'other'} mass of the unit"
            yield of_file("mass", name, with_payload(factor, same_mass=same), (*MASS_WORDS, "payload"))


def geometry() -> Iterator[Corruption]:
    for unit in (TRACTOR_UNIT, TRAILER_UNIT):
        for by in (-0.5, -0.25, 0.25, 0.5):
            yield of_file("geometry", f"CoG of {unit} {by:+g} m", shifted(f"{unit}.cog", by), GEOMETRY_WORDS)
        for factor in (0.9, 0.95, 0.98, 1.02, 1.05, 1.1):
            change = scaled(factor, ".position", unit=unit)
            yield of_file("geometry", f"wheelbase of {unit} x {factor:g}", change, GEOMETRY_WORDS)
    for by in (-0.3, -0.1, 0.1, 0.3):
        change = shifted("fifth_wheel.leading_position", by)
        yield of_file("geometry", f"fifth wheel {by:+g} m", change, (*GEOMETRY_WORDS, "fifth wheel", "coupling"))


def roll_and_tyres() -> Iterator[Corruption]:
    scales = {
        ".roll_stiffness": (0.6, 1.5),
        ".tyre_roll_stiffness": (0.6, 1.5),
        ".roll_axis_height": (0.5, 1.5),
        ".roll_damping": (0.5, 2.0),
        ".sprung.cog_height": (0.8, 1.2),
        ".sprung.roll_inertia": (0.5, 2.0),
    }
    for end, factors in scales.items():
        for unit in (TRACTOR_UNIT, TRAILER_UNIT):
            for factor in factors:
                yield of_file("roll", f"{unit}{end} x {factor:g}", scaled(factor, end, unit=unit), ROLL_WORDS)
    suspensions = [scaled(1.5, ".roll_stiffness", unit=unit) for unit in (TRACTOR_UNIT, TRAILER_UNIT)]
    yield of_file("roll", "all suspensions x 1.5", all_of(*suspensions), ROLL_WORDS)
    for factor in (0.5, 2.0):
        yield of_file("roll", f"fifth_wheel x {factor:g}", scaled(factor, "fifth_wheel.roll_stiffness"), ROLL_WORDS)
    for by in (-0.2, 0.2):
        change = shifted(f"{TRAILER_UNIT}.payload.floor_height", by)
        yield of_file("roll", f"floor {by:+g} m", change, (*ROLL_WORDS, "floor"))
    for factor in (0.8, 1.2):
        yield of_file("roll", f"payload width x {factor:g}", scaled(factor, ".payload.width"), (*ROLL_WORDS, "width"))
    for factor in (0.0, 2.0):
        words = ("relaxation",)
        yield of_file("tyres and inertia", f"relaxation x {factor:g}", scaled(factor, ".relaxation_length"), words)
    for factor in (0.7, 1.4):
        change, words = scaled(factor, ".yaw_inertia", unit=TRACTOR_UNIT), ("tractor.yaw_inertia",)
        yield of_file("tyres and inertia", f"yaw inertia of tractor x {factor:g}", change, words)


def of_signal(category: str, name: str, signal: str, change: OfSignal, *words: str) -> Corruption:
    """The corruption of one signal; a message on the signal names the cause."""
    return Corruption(name=name, category=category, words=(*words_of([signal]), *words), record=on(signal, change))


def words_of(signals: Iterable[str]) -> tuple[str, ...]:
    """What a message on one of the signals contains; many messages contain the word "speed"."""
    return tuple(word for name in signals for word in (("speed:", "speed in") if name == SPEED else (name,)))


def of_file(category: str, name: str, change: OfVehicle, words: tuple[str, ...]) -> Corruption:
    """The corruption of the vehicle file."""
    return Corruption(name=name, category=f"file: {category}", words=words, vehicle=change)


CORRUPTIONS: Mapping[str, Corruption] = {
    corruption.name: corruption
    for part in (
        *(time_bases, gains, biases, noise, faults, mounting, steering_and_road),
        *(masses, geometry, roll_and_tyres),
    )
    for corruption in part()
}
"""All corruptions by name."""
