"""From what MuJoCo sensed to signals: the truth beside which sensors and estimators are judged. SI, ISO 8855."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fifthwheel.errors import SignalError
from fifthwheel.plant.properties import Properties
from fifthwheel.plant.tyres import PER_BODY, WHEEL, Layout
from fifthwheel.vehicle import Vehicle

Array = NDArray[np.float64]
OVER = 0.6
"""Roll angle beyond which a truck falls over, rad."""
JACKKNIFED = 1.5
"""Articulation angle at which units touch, rad."""


@dataclass(frozen=True)
class Layer:
    """Rows of a drive as they are kept."""

    sensed: Array  # (N, sensed and steer angles)
    wheels: Array  # (N, 4 for each wheel)

    @classmethod
    def empty(cls, rows: int, layout: Layout, wheels: int) -> "Layer":
        return cls(np.full((rows, layout.sensed + len(layout.steered)), np.nan), np.full((rows, wheels), np.nan))

    def keep(self, row: int, sensed: Array, output: Array) -> None:
        self.sensed[row] = sensed
        self.wheels[row] = output[len(output) - self.wheels.shape[1] :]


@dataclass(frozen=True)
class Frame:
    """A body's frame over time, each (N, 3) in the world's axes."""

    place: Array
    ahead: Array
    across: Array
    velocity: Array
    turning: Array

    @classmethod
    def of(cls, sensed: Array) -> "Frame":
        return cls(*(sensed[:, 3 * k : 3 * k + 3] for k in range(5)))

    @property
    def upward(self) -> Array:
        return np.cross(self.ahead, self.across)

    @property
    def heading(self) -> Array:
        return np.unwrap(np.arctan2(self.ahead[:, 1], self.ahead[:, 0]))

    def at(self, x: float, z: float) -> tuple[Array, Array]:
        """Place and velocity of a point of the body, each (N, 3)."""
        arm = x * self.ahead + z * self.upward
        return self.place + arm, self.velocity + np.cross(self.turning, arm)


def truth(time: Array, layers: Layer, vehicle: Vehicle, properties: Properties, layout: Layout) -> dict[str, Array]:
    """Every signal of a drive, (N,) each.

    Yaw and roll rates are those of gyros fixed to the sprung body; sideslip is that of the point of the body on the
    roll axis under the CoG of the whole unit, in the horizontal plane; lateral_acceleration what an accelerometer shows
    there. lateral_force and slip_angle of an axle are those of its wheels together, load_transfer right minus left by
    the sum.

    Raises:
        SignalError: the truck rolled over, jackknifed or stopped.
    """
    found: dict[str, Array] = {}
    headings: list[Array] = []
    for i, unit in enumerate(vehicle.units):
        frame = Frame.of(layers.sensed[:, PER_BODY * i : PER_BODY * (i + 1)])
        shown = layers.sensed[:, PER_BODY * i + 15 : PER_BODY * i + 18]
        heading, upward = frame.heading, frame.upward
        headings.append(heading)
        u, v, place = horizontal(frame, heading, unit.cog, unit.roll_axis_height)
        found |= {
            f"{quantity}.{unit.name}": values
            for quantity, values in {
                "position_x": place[:, 0],
                "position_y": place[:, 1],
                "yaw": heading,
                "roll": np.arctan2(frame.across[:, 2], upward[:, 2]),
                "pitch": -np.arcsin(frame.ahead[:, 2]),
                "yaw_rate": np.sum(frame.turning * upward, axis=1),
                "roll_rate": np.sum(frame.turning * frame.ahead, axis=1),
                "pitch_rate": np.sum(frame.turning * frame.across, axis=1),
                "longitudinal_velocity": u,
                "lateral_velocity": v,
                "sideslip": np.arctan2(v, u),
                "longitudinal_acceleration": shown[:, 0],
                "lateral_acceleration": shown[:, 1],
            }.items()
        }
        if i:
            found[f"articulation.{unit.name}"] = heading - headings[i - 1]
        if i == len(vehicle.units) - 1 and i:
            u, v, _ = horizontal(frame, heading, properties.landing_leg, 0.0)
            found[f"sideslip.{unit.name}.landing_leg"] = np.arctan2(v, u)
    found["speed"] = found[f"longitudinal_velocity.{vehicle.units[0].name}"]
    found |= {name: layers.sensed[:, layout.sensed + k] for k, name in enumerate(vehicle.steer_signals())}
    axles = [f"{unit.name}.{axle.name}" for unit in vehicle.units for axle in unit.axles]
    for i, axle in enumerate(axles):
        left, right = (dict(zip(WHEEL, layers.wheels[:, 4 * k : 4 * k + 4].T, strict=True)) for k in (2 * i, 2 * i + 1))
        load = left["vertical_force"] + right["vertical_force"]
        found |= {
            f"slip_angle.{axle}": np.arctan((left["slip"] + right["slip"]) / 2),
            f"lateral_force.{axle}": left["lateral_force"] + right["lateral_force"],
            f"longitudinal_force.{axle}": left["longitudinal_force"] + right["longitudinal_force"],
            f"vertical_force.{axle}": load,
            f"load_transfer.{axle}": (right["vertical_force"] - left["vertical_force"]) / load,
        }
    refuse_fallen(time, found, vehicle)
    return found


def horizontal(frame: Frame, heading: Array, x: float, z: float) -> tuple[Array, Array, Array]:
    """Longitudinal and lateral velocity of a point of a body in the road's plane, (N,), and its place (N, 3)."""
    place, velocity = frame.at(x, z)
    c, s = np.cos(heading), np.sin(heading)
    return c * velocity[:, 0] + s * velocity[:, 1], c * velocity[:, 1] - s * velocity[:, 0], place


def refuse_fallen(time: Array, found: dict[str, Array], vehicle: Vehicle) -> None:
    """Raise at the first sample at which the truck no longer drives."""
    for unit in vehicle.units:
        for what, values, limit in (
            ("rolled over", found[f"roll.{unit.name}"], OVER),
            ("jackknifed", found.get(f"articulation.{unit.name}", np.zeros_like(time)), JACKKNIFED),
        ):
            bad = ~(np.abs(values) < limit)
            if bad.any():
                raise SignalError(
                    f"{unit.name}: {what} at {time[bad.argmax()]:.1f} s; drive a gentler course, or slower"
                )
    stopped = found["speed"] < 1.0
    if stopped.any():
        raise SignalError(f"speed: the truck came to a stop at {time[stopped.argmax()]:.1f} s; the tyres need to roll")
