"""An exact simulation of the linear vehicle by matrix exponentials, with process noise, independent of the filters."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.linalg import expm

from fifthwheel.base.types import Array
from fifthwheel.data.channels import channel_of
from fifthwheel.data.record import Record
from fifthwheel.estimate.filters.initial_state import TYPICAL_STEER_SIGMA, initial_state
from fifthwheel.estimate.filters.variances import OBSERVER_PROCESS_VARIANCE
from fifthwheel.model import dynamics
from fifthwheel.truck import Vehicle, get
from tests.estimate.observe.conftest import ROLLS, STEER, YAWS

SPEED = 88 / 3.6
OUTPUTS = (*YAWS, *ROLLS)
TRUCK = get("cheng_cebon_2011").with_logged_steering({STEER}, "the signals")


@dataclass(frozen=True, kw_only=True)
class Exact:
    """The vehicle at one speed, x+ = F x + before d + after d+ from sample to sample."""

    vehicle: Vehicle
    values: Mapping[str, float]  # that replace those of the vehicle, by path
    states: tuple[str, ...]
    F: Array  # (N, n, n)
    before: Array  # (N, n)
    after: Array  # (N, n)
    Q: Array  # (N, n), variances of the process noise of each step
    x0: Array
    P0: Array
    R: Array  # (m,)

    def sideslip(self) -> Array:
        """Rows (2, n): sideslip of both units under the CoG by the state, from the kinematics of the coupling."""
        p = self.vehicle.parameters() | dict(self.values)
        e = {name: np.eye(len(self.states))[i] for i, name in enumerate(self.states)}
        first, height = e["lateral_velocity.tractor"], p["fifth_wheel.height"]
        coupling = (
            first
            + (p["fifth_wheel.leading_position"] - p["tractor.cog"]) * e["yaw_rate.tractor"]
            - (height - p["tractor.roll_axis_height"]) * e["roll_rate.tractor"]
        )
        second = (
            coupling
            - SPEED * e["articulation.semitrailer"]
            - (p["fifth_wheel.trailing_position"] - p["semitrailer.cog"]) * e["yaw_rate.semitrailer"]
            + (height - p["semitrailer.roll_axis_height"]) * e["roll_rate.semitrailer"]
        )
        return np.array([first, second]) / SPEED

    def load_transfer(self, path: str) -> Array:
        """Row (n,): the load transfer ratio of an axle group by the state, from the moments on its axles."""
        e = dict(zip(self.states, np.eye(len(self.states)), strict=True))
        p = self.vehicle.parameters() | dict(self.values)
        unit = self.vehicle.unit(path.split(".")[0])
        axles = sum(len(group.axles) for group in unit.axle_groups if unit.group_path(group) == path)
        weight = (unit.mass - unit.laden_sprung_mass) * axles / len(unit.axles) * 9.80665
        load, tyres = self.vehicle.axle_loads()[path], p[f"{path}.tyre_roll_stiffness"]
        series = tyres / (tyres + p[f"{path}.roll_stiffness"])
        force = p[f"{path}.cornering_stiffness"] * e[f"slip_angle.{path}"]
        roll = p[f"{path}.roll_stiffness"] * series * e[f"roll.{unit.name}"]
        damping = p[f"{path}.roll_damping"] * series**2 * e[f"roll_rate.{unit.name}"]
        return (roll + damping + force * (unit.roll_axis_height * (1 - weight / load) + 0.5 * weight / load)) / load

    def rows(self, name: str) -> Array:
        """Row (n,) of a reported signal by the state."""
        if name.startswith("sideslip."):
            return self.sideslip()[int(name.endswith("semitrailer"))]
        if name.startswith("load_transfer."):
            return self.load_transfer(name.removeprefix("load_transfer."))
        return np.eye(len(self.states))[self.states.index(name)]


def exact_system(time: Array, first: float, *, values: Mapping[str, float] = {}, process_noise: float = 1.0) -> Exact:
    """The vehicle at the times of a record whose first steer angle is `first`, rad."""
    m = dynamics.matrices(TRUCK, SPEED, roll=True, changed=values)
    n = len(m.A)
    step = np.diff(time, prepend=time[0]).round(9)
    table = {dt: first_order_hold(m.A, m.B, dt) for dt in set(step.tolist())}
    F, before, after = (np.array([table[dt][i] for dt in step.tolist()]) for i in range(3))
    x0, P0 = initial_state(TRUCK, {"speed": SPEED, STEER: first}, values, roll=True, steer_sigma=TYPICAL_STEER_SIGMA)
    noise = np.array([OBSERVER_PROCESS_VARIANCE[name.split(".")[0]] for name in m.states]) * process_noise
    R = np.array([channel_of(name).noise[0 if name.endswith(".tractor") else 1] for name in OUTPUTS])
    return Exact(
        vehicle=TRUCK,
        values=values,
        states=m.states,
        F=F,
        before=before.reshape(-1, n),
        after=after.reshape(-1, n),
        Q=step[:, None] * noise,
        x0=x0,
        P0=P0,
        R=R,
    )


def first_order_hold(A: Array, B: Array, dt: float) -> tuple[Array, Array, Array]:
    """Transition, and input matrices of the steer angles at the beginning and at the end of a step."""
    n = len(A)
    matrix = np.zeros((n + 2, n + 2))
    matrix[:n, :n], matrix[:n, n : n + 1], matrix[n, n + 1] = A, B, 1.0
    exponential = expm(matrix * dt)
    slope = exponential[:n, n + 1 :] / dt if dt else np.zeros((n, 1))
    return exponential[:n, :n], exponential[:n, n : n + 1] - slope, slope


def simulate_exact(
    system: Exact, time: Array, steer: Array, rng: np.random.Generator, *, offset: float = 0.0
) -> Record:
    """A record from a random start with covariance P0; the steer sensor has an offset, rad."""
    x = np.empty((len(time), len(system.x0)))
    x[0] = system.x0 + np.linalg.cholesky(system.P0) @ rng.normal(size=len(system.x0))
    noise = rng.normal(size=x.shape) * np.sqrt(system.Q)
    for k in range(1, len(time)):
        x[k] = system.F[k] @ x[k - 1] + system.before[k] * steer[k - 1] + system.after[k] * steer[k] + noise[k]
    measured = x[:, [system.states.index(name) for name in OUTPUTS]]
    measured = measured + rng.normal(size=measured.shape) * np.sqrt(system.R)
    signals = {"speed": np.full(len(time), SPEED), STEER: steer + offset}
    reported = (
        "sideslip.tractor",
        "sideslip.semitrailer",
        "articulation.semitrailer",
        "roll.tractor",
        "roll.semitrailer",
    )
    return Record(
        time=time,
        signals=signals | {name: measured[:, i] for i, name in enumerate(OUTPUTS)},
        reference={name: x @ system.rows(name) for name in reported},
        name="exact",
    )


def lane_change_steer(time: Array) -> Array:
    """Steer angle, rad: two periods of 0.4 Hz, then zero."""
    return np.asarray(0.02 * np.sin(2 * np.pi * 0.4 * time) * (time < 5))
