"""A truck in ordinary driving on hilly roads: engine, gears, driver, traffic, wind, and the signals of its CAN bus.

The longitudinal motion only, as the truth for estimates of the mass. The equations are its own, with more detail than
an estimator has: losses for each gear, torsion of the driveline, rolling resistance that depends on speed, gusts, turbo
lag, filters and quantisation of SAE J1939-71 (EEC1, EEC3, CCVS).
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from fifthwheel._types import Array
from fifthwheel.record import Record

STEP = 0.01
"""s"""
GRAVITY = 9.81
"""m/s^2"""
GEARS = (14.9, 11.7, 9.0, 7.0, 5.6, 4.4, 3.4, 2.67, 2.1, 1.63, 1.27, 1.0)
"""Ratios of a gearbox of heavy trucks; the last one is direct."""
SPEEDS = np.array([30, 50, 50, 60, 70, 80, 85, 85, 88]) / 3.6
"""Of traffic, m/s; a red light or a roundabout stops or slows it in between."""
SHIFT = (0.35, 0.65, 0.45)
"""s: torque falls, the clutch is open, torque rises."""
RPM = 2 * np.pi / 60


@dataclass(frozen=True, kw_only=True)
class DrivenTruck:
    """A truck with the errors of its sensors; see `drawn`."""

    mass: float
    """kg"""
    wheels: int = 12
    drag_area: float = 6.0
    """m^2"""
    rolling_resistance: float = 0.0055
    efficiency: float = 0.955
    """From the engine to the wheels in direct gear; other gears lose 1.2 % more."""
    engine_inertia: float = 3.5
    """kg m^2"""
    wheel_inertia: float = 13.5
    """Of one wheel, kg m^2."""
    radius: float = 0.5
    """m"""
    final_drive: float = 2.6
    max_torque: float = 2500.0
    """N m; also the reference of the torque signals."""
    torque_scale: float = 1.0
    """Shown torque = scale * torque + offset."""
    torque_offset: float = 0.0
    """N m"""
    speed_scale: float = 1.0
    speed_delay: float = 0.1
    """Of filter and bus, s."""
    wind: float = 0.0
    """Mean head wind, m/s."""
    hills: float = 0.02
    """Standard deviation of the grade."""
    vertical_curve: float = 50.0
    """Length over which the grade changes, m."""
    hill_length: float = 400.0
    """m"""
    anticipation: float = 0.5
    """Fraction of the grade that the driver sees and corrects for; the rest shows in the speed first."""

    @classmethod
    def drawn(cls, mass: float, rng: np.random.Generator, **given: float) -> "DrivenTruck":
        """A truck with random numbers and sensor errors, except those that are given."""
        numbers = {
            "drag_area": 6.0 * (1 + 0.15 * rng.normal()),
            "rolling_resistance": 0.0055 + 0.001 * rng.normal(),
            "efficiency": 0.955 * (1 + 0.01 * rng.normal()),
            "engine_inertia": 3.5 * np.exp(0.3 * rng.normal()),
            "wheel_inertia": 13.5 * np.exp(0.2 * rng.normal()),
            "radius": rng.uniform(0.48, 0.52),
            "torque_scale": 1 + 0.02 * rng.normal(),
            "torque_offset": 25.0 * rng.normal(),
            "speed_scale": 1 + 0.007 * rng.normal(),
            "speed_delay": rng.uniform(0.05, 0.15),
            "wind": 2.5 * rng.normal(),
            "hills": rng.uniform(0.01, 0.03),
            "vertical_curve": rng.uniform(30.0, 100.0),
            "hill_length": rng.uniform(200.0, 800.0),
            "anticipation": rng.uniform(0.0, 1.0),
        }
        return cls(mass=mass, **(numbers | given))


def drive(
    truck: DrivenTruck, *, duration: float = 600.0, seed: int = 0, rate: float = 50.0, name: str = "drive"
) -> Record:
    """The log of a drive with stops and hills, all of it random.

    The reference has the true speed and grade.

    Args:
        duration: s.
        rate: of the log, Hz.

    Example:
        >>> from fifthwheel.plant.driving import DrivenTruck, drive
        >>> sorted(drive(DrivenTruck(mass=30e3), duration=20.0).signals)[:3]
        ['braking.tractor', 'driveline_engaged', 'engine_speed']
    """
    rng = np.random.default_rng(seed)
    n, every = round(duration / STEP), round(1 / (rate * STEP))
    truth = _Motion(truck, rng, n).run(_traffic(rng, n))
    speed, engine, torque, friction, engaged, braking, grade = truth.T
    reference, lag = truck.max_torque, STEP / (0.05 + STEP)
    shown, filtered = np.empty(n), speed[0]
    for k in range(n):
        filtered += lag * (speed[k] - filtered)
        shown[k] = filtered
    late = round(max(truck.speed_delay - 0.05, 0.0) / STEP)
    shown = np.concatenate([np.full(late, shown[0]), shown])[:n] * truck.speed_scale
    rows, coarse = np.arange(0, n, every), np.arange(0, n, round(0.1 / STEP))
    quantum = 1 / 256 / 3.6
    sent = np.round(np.maximum(shown[coarse] + 0.01 * rng.normal(size=coarse.size), 0.0) / quantum) * quantum
    indicated = truck.torque_scale * torque + truck.torque_offset + friction
    signals = {
        "speed": np.interp(rows, coarse, sent),
        "engine_speed": np.round(engine[rows] / RPM * 8) / 8 * RPM,
        "engine_torque": np.round(indicated[rows] / reference * 100) / 100 * reference,
        "friction_torque": np.round(friction[rows] / reference * 100) / 100 * reference,
        "driveline_engaged": engaged[rows],
        "braking.tractor": braking[rows],
    }
    true = {"speed": speed[rows], "grade": grade[rows]}
    return Record(time=STEP * rows.astype(float), signals=signals, reference=true, name=name)


def _traffic(rng: np.random.Generator, n: int) -> Array:
    """The speed that traffic permits at every instant, m/s."""
    speed = np.empty(n)
    k = 0
    while k < n:
        for value, mean in ((rng.choice(SPEEDS), 45.0), (rng.choice([0.0, 5.0, 8.0, 14.0]), 5.0)):
            length = round(rng.exponential(mean) / STEP) + round(5 / STEP)
            speed[k : k + length] = value + rng.normal()
            k += length
    return np.maximum(speed, 0.0)


class _Motion:
    """The truck on its road."""

    def __init__(self, truck: DrivenTruck, rng: np.random.Generator, n: int) -> None:
        self.truck, self.rng, self.n = truck, rng, n
        self.noise = rng.normal(size=n)
        # Vertical alignment of a road, at every metre: white noise through two poles.
        grades = rng.normal(size=40_000)
        for length in (truck.vertical_curve, truck.hill_length):
            grades = lfilter([1 / length], [1, 1 / length - 1], grades)
        self.grades = truck.hills * grades / grades.std()

    def run(self, traffic: Array) -> Array:
        """(N, 7): speed, engine speed, net torque, friction torque, clutch closed, braking, grade."""
        t, out = self.truck, np.empty((self.n, 7))
        v = place = wheel_force = force_rate = gust = torque = seen = 0.0
        gear, shift, target_gear, wait = 3, 9.0, 3, 0.0
        idle = 600 * RPM
        engine = idle
        wanted = plan = integral = demand = 0.0
        full_load = np.interp(np.arange(3000.0), [600, 950, 1400, 1900, 2100], [0.55, 1.0, 1.0, 0.74, 0.0]).tolist()
        grades, noise, traffic = self.grades.tolist(), self.noise.tolist(), traffic.tolist()
        rotating_wheels = t.wheels * t.wheel_inertia / t.radius**2
        for k in range(self.n):
            plan += (min(max(0.4 * (traffic[k] - wanted), -0.8), 0.9) - plan) * STEP / 0.8  # m/s^2
            wanted = max(wanted + plan * STEP, 0.0)
            error = wanted - v
            integral = min(max(integral + 0.05 * error * STEP, -0.5), 0.5)
            demand += (0.4 * error + integral + plan - demand) * STEP / 0.6  # m/s^2, with the reaction of a driver
            ratio = GEARS[gear] * t.final_drive / t.radius
            grade = grades[int(place) % len(grades)]
            seen += (t.anticipation * grade - seen) * STEP / 0.6
            air = v + t.wind + gust
            resistance = 0.6 * t.drag_area * air * abs(air)
            resistance += t.mass * GRAVITY * t.rolling_resistance * (1 + 0.004 * v) * (v > 0.05)
            needed = t.mass * demand + resistance + t.mass * GRAVITY * seen
            # Gear: after a dwell, so that the engine runs at 1000 to 1500 rpm, higher uphill.
            wait -= STEP
            if shift > sum(SHIFT) and wait <= 0:
                revolutions, load = v * ratio / RPM, min(max(grade, 0.0) / 0.04, 1.0)
                up, down = 1350 + 250 * load + 150 * (error > 2), 950 + 150 * load
                if revolutions > up and gear < len(GEARS) - 1:
                    target_gear = min(gear + (2 if gear < 7 and load < 0.5 else 1), len(GEARS) - 1)
                elif revolutions < down and gear > 2:
                    target_gear = max(gear - (2 if error < 0 else 1), 2)
                if target_gear != gear:
                    shift, wait = 0.0, 3.5
            shifting = shift <= sum(SHIFT)
            if shifting:
                shift += STEP
                if shift >= SHIFT[0] + SHIFT[1] / 2:
                    gear = target_gear
            clutch_open = SHIFT[0] < shift <= SHIFT[0] + SHIFT[1]
            launching = v * ratio < idle
            limit = t.max_torque * full_load[int(engine / RPM)]
            friction = 90.0 + 0.9 * engine
            torque_wanted = min(max(needed / (ratio * t.efficiency), 0.0), limit)
            if shifting and shift <= SHIFT[0]:
                torque_wanted = 0.0
            if clutch_open:
                torque_wanted = 0.0
            if torque_wanted <= 0:
                torque_wanted = -friction if not (clutch_open or launching) else 0.0  # overrun without fuel
            torque += (torque_wanted - torque) * STEP / (0.12 if torque_wanted < torque else 0.3)
            braking = needed < -1.15 * friction * ratio - 0.02 * t.mass or (wanted < 0.3 and v < 2)
            if clutch_open:
                force, inertia = 0.0, 0.0
            elif launching:  # the clutch slips
                force, inertia = max(torque, 0.0) * ratio * t.efficiency, 0.0
            else:
                loss = t.efficiency * (1.0 if gear == len(GEARS) - 1 else 0.988)
                force = torque * ratio * (loss if torque > 0 else 1 / loss)
                inertia = t.engine_inertia * ratio**2
            # Torsion of the driveline, 4 Hz: the force at the wheels follows that of the engine.
            force_rate += ((force - wheel_force) * 25.0**2 - 2 * 0.35 * 25.0 * force_rate) * STEP
            wheel_force += force_rate * STEP
            brake = min(max(-needed, 0.0), 3.0 * t.mass) if braking else 0.0
            if clutch_open:
                wheel_force = force_rate = 0.0
            total = t.mass + rotating_wheels + inertia
            v += (wheel_force - resistance - t.mass * GRAVITY * grade / math.sqrt(1 + grade**2) - brake) / total * STEP
            v = max(v, 0.0)
            place += v * STEP
            gust += -gust * STEP / 4.0 + math.sqrt(2 * STEP / 4.0) * noise[k]
            goal = max(v * ratio, idle)
            engine += (goal - engine) * (STEP / 0.15 if clutch_open or launching else 1.0)
            out[k] = v, engine, torque, friction, not (clutch_open or launching), braking, grade
        return out
