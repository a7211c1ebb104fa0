"""The linear truck moved by matrix exponentials, with process noise: nothing of the filters is used."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from fifthwheel import dynamics
from fifthwheel.logs import Record
from fifthwheel.logs.noise import GYROS
from fifthwheel.observe.noise import OBSERVED, SWING, initial
from fifthwheel.observe.prepare import locked_but
from fifthwheel.vehicle import Vehicle, get

from .conftest import ROLLS, STEER, YAWS

Array = NDArray[np.float64]
SPEED = 88 / 3.6
OUTPUTS = (*YAWS, *ROLLS)
TRUCK = locked_but(get("cheng_cebon_2011"), {STEER}, "the signals")


@dataclass(frozen=True, kw_only=True)
class Exact:
    """The truck's motion at one speed, x+ = F x + before d + after d+ from sample to sample."""

    vehicle: Vehicle
    values: Mapping[str, float]  # in place of the vehicle's, by path
    states: tuple[str, ...]
    F: Array  # (N, n, n)
    before: Array  # (N, n)
    after: Array  # (N, n)
    Q: Array  # (N, n): variances of the process noise that each step adds
    x0: Array
    P0: Array
    R: Array  # (m,)

    def sideslip(self) -> Array:
        """Rows (2, n) that make both units' sideslip under the CoG of the state, by the coupling's kinematics."""
        p = self.vehicle.parameters() | dict(self.values)
        e = {name: np.eye(len(self.states))[i] for i, name in enumerate(self.states)}
        first, above = e["lateral_velocity.tractor"], p["fifth_wheel.height"]
        coupling = (
            first
            + (p["fifth_wheel.leading_position"] - p["tractor.cog"]) * e["yaw_rate.tractor"]
            - (above - p["tractor.roll_axis_height"]) * e["roll_rate.tractor"]
        )
        second = (
            coupling
            - SPEED * e["articulation.semitrailer"]
            - (p["fifth_wheel.trailing_position"] - p["semitrailer.cog"]) * e["yaw_rate.semitrailer"]
            + (above - p["semitrailer.roll_axis_height"]) * e["roll_rate.semitrailer"]
        )
        return np.array([first, second]) / SPEED

    def rows(self, name: str) -> Array:
        """How a reported signal is made of the state, (n,)."""
        if name.startswith("sideslip."):
            return self.sideslip()[int(name.endswith("semitrailer"))]
        return np.eye(len(self.states))[self.states.index(name)]


def exact(time: Array, first: float, *, values: Mapping[str, float] = {}, process_noise: float = 1.0) -> Exact:
    """The truck at the times of a record; `first` is its first steer angle, rad."""
    m = dynamics.matrices(TRUCK, SPEED, roll=True, changed=values)
    n = len(m.A)
    step = np.diff(time, prepend=time[0]).round(9)
    table = {dt: held(m.A, m.B, dt) for dt in set(step.tolist())}
    F, before, after = (np.array([table[dt][i] for dt in step.tolist()]) for i in range(3))
    x0, P0 = initial(TRUCK, {"speed": SPEED, STEER: first}, values, roll=True, swing=SWING)
    noise = np.array([OBSERVED[name.split(".")[0]] for name in m.states]) * process_noise
    R = np.array([GYROS[name.split(".")[0]][0 if name.endswith(".tractor") else 1] for name in OUTPUTS])
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


def held(A: Array, B: Array, dt: float) -> tuple[Array, Array, Array]:
    """Transition, and what the steer angles at the begin and at the end of a step do, linear in between."""
    n = len(A)
    whole = np.zeros((n + 2, n + 2))
    whole[:n, :n], whole[:n, n : n + 1], whole[n, n + 1] = A, B, 1.0
    moved = expm(whole * dt)
    slope = moved[:n, n + 1 :] / dt if dt else np.zeros((n, 1))
    return moved[:n, :n], moved[:n, n : n + 1] - slope, slope


def drive(system: Exact, time: Array, steer: Array, random: np.random.Generator, *, offset: float = 0.0) -> Record:
    """A record of the truck: it starts anywhere within P0; the steer sensor shows `offset` too much."""
    x = np.empty((len(time), len(system.x0)))
    x[0] = system.x0 + np.linalg.cholesky(system.P0) @ random.normal(size=len(system.x0))
    noise = random.normal(size=x.shape) * np.sqrt(system.Q)
    for k in range(1, len(time)):
        x[k] = system.F[k] @ x[k - 1] + system.before[k] * steer[k - 1] + system.after[k] * steer[k] + noise[k]
    measured = x[:, [system.states.index(name) for name in OUTPUTS]]
    measured = measured + random.normal(size=measured.shape) * np.sqrt(system.R)
    signals = {"speed": np.full(len(time), SPEED), STEER: steer + offset}
    told = ("sideslip.tractor", "sideslip.semitrailer", "articulation.semitrailer", "roll.tractor", "roll.semitrailer")
    return Record(
        time=time,
        signals=signals | {name: measured[:, i] for i, name in enumerate(OUTPUTS)},
        reference={name: x @ system.rows(name) for name in told},
        name="exact",
    )


def lane_change(time: Array) -> Array:
    """Steer angle, rad: two periods of 0.4 Hz, then straight."""
    return np.asarray(0.02 * np.sin(2 * np.pi * 0.4 * time) * (time < 5))
