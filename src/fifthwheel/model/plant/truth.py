"""True signals of a run, computed from what MuJoCo senses: the reference for sensors and estimators. SI, ISO 8855."""

from dataclasses import dataclass

import numpy as np

from fifthwheel.base.errors import SignalError
from fifthwheel.base.types import Array
from fifthwheel.model.plant.properties import Properties
from fifthwheel.model.plant.tyre_forces import BODY_SENSORS, WHEEL_OUTPUTS, StepLayout
from fifthwheel.truck import Vehicle

ROLLOVER_ANGLE = 0.6
"""Roll angle beyond which a truck rolls over, rad."""
JACKKNIFE_ANGLE = 1.5
"""Articulation angle at which units touch, rad."""
LOWEST_SPEED = 1.0
"""Speed below which the tyre model is not valid, m/s."""


@dataclass(frozen=True)
class BodyFrame:
    """The frame of a body over time: each array (N, 3) in world axes."""

    position: Array
    x_axis: Array
    y_axis: Array
    velocity: Array
    angular_velocity: Array

    @classmethod
    def of(cls, sensed: Array) -> "BodyFrame":
        """The frame by the first 15 sensed values of a body, (N, 15 or more)."""
        return cls(*(sensed[:, 3 * k : 3 * k + 3] for k in range(5)))

    @property
    def z_axis(self) -> Array:
        """(N, 3)."""
        return np.cross(self.x_axis, self.y_axis)

    @property
    def heading(self) -> Array:
        """Continuous heading angle of the x axis, rad, (N,)."""
        return np.unwrap(np.arctan2(self.x_axis[:, 1], self.x_axis[:, 0]))

    def horizontal_motion(self, x: float, z: float) -> tuple[Array, Array, Array]:
        """Longitudinal and lateral velocity in the horizontal plane, (N,), and position, (N, 3), of a point."""
        arm = x * self.x_axis + z * self.z_axis
        velocity = self.velocity + np.cross(self.angular_velocity, arm)
        c, s = np.cos(self.heading), np.sin(self.heading)
        u, v = c * velocity[:, 0] + s * velocity[:, 1], c * velocity[:, 1] - s * velocity[:, 0]
        return u, v, self.position + arm


def true_signals(
    time: Array, sensed: Array, wheels: Array, vehicle: Vehicle, properties: Properties, layout: StepLayout
) -> dict[str, Array]:
    """Every signal of a run, (N,) each, by name.

    From the sensed values and steer angles at each instant, and the `WHEEL_OUTPUTS` of each wheel.

    Yaw and roll rates are those of gyros fixed to the sprung body. Sideslip is that of the point of the body on the
    roll axis below the CoG of the whole unit, in the horizontal plane. Accelerations are those of an accelerometer on
    the body, where the vehicle file has it, by default at that point; they contain gravity. Lateral force and slip
    angle of an axle combine both wheels; load transfer is the right load minus the left one, divided by their sum. A
    SignalError if the truck rolls over, jackknifes or stops.
    """
    signals: dict[str, Array] = {}
    headings: list[Array] = []
    for i, unit in enumerate(vehicle.units):
        of_body = sensed[:, BODY_SENSORS * i : BODY_SENSORS * (i + 1)]
        frame, acceleration = BodyFrame.of(of_body), of_body[:, 15:18]
        heading, z_axis = frame.heading, frame.z_axis
        headings.append(heading)
        u, v, position = frame.horizontal_motion(unit.cog, unit.roll_axis_height)
        signals |= {
            f"{quantity}.{unit.name}": values
            for quantity, values in {
                "position_x": position[:, 0],
                "position_y": position[:, 1],
                "yaw": heading,
                "roll": np.arctan2(frame.y_axis[:, 2], z_axis[:, 2]),
                "pitch": -np.arcsin(frame.x_axis[:, 2]),
                "yaw_rate": np.sum(frame.angular_velocity * z_axis, axis=1),
                "roll_rate": np.sum(frame.angular_velocity * frame.x_axis, axis=1),
                "pitch_rate": np.sum(frame.angular_velocity * frame.y_axis, axis=1),
                "longitudinal_velocity": u,
                "lateral_velocity": v,
                "sideslip": np.arctan2(v, u),
                "longitudinal_acceleration": acceleration[:, 0],
                "lateral_acceleration": acceleration[:, 1],
            }.items()
        }
        if i:
            signals[f"articulation.{unit.name}"] = heading - headings[i - 1]
        if i == len(vehicle.units) - 1 and i:
            u, v, _ = frame.horizontal_motion(properties.landing_leg, 0.0)
            signals[f"sideslip.{unit.name}.landing_leg"] = np.arctan2(v, u)
    signals["speed"] = signals[f"longitudinal_velocity.{vehicle.units[0].name}"]
    signals |= {name: sensed[:, layout.sensed + k] for k, name in enumerate(vehicle.steer_signals())}
    axles, n = [f"{unit.name}.{axle.name}" for unit in vehicle.units for axle in unit.on_road], len(WHEEL_OUTPUTS)
    for i, axle in enumerate(axles):
        left, right = (
            dict(zip(WHEEL_OUTPUTS, wheels[:, n * k : n * k + n].T, strict=True)) for k in (2 * i, 2 * i + 1)
        )
        load = left["vertical_force"] + right["vertical_force"]
        signals |= {
            f"slip_angle.{axle}": np.arctan((left["slip"] + right["slip"]) / 2),
            f"lateral_force.{axle}": left["lateral_force"] + right["lateral_force"],
            f"longitudinal_force.{axle}": left["longitudinal_force"] + right["longitudinal_force"],
            f"vertical_force.{axle}": load,
            f"load_transfer.{axle}": (right["vertical_force"] - left["vertical_force"]) / load,
            f"wheel_speed.{axle}.left": left["speed"],
            f"wheel_speed.{axle}.right": right["speed"],
        }
    check_run(time, signals, vehicle)
    return signals


def check_run(time: Array, signals: dict[str, Array], vehicle: Vehicle) -> None:
    """Raise SignalError with the first instant at which a unit rolls over or jackknifes, or the truck stops."""
    for unit in vehicle.units:
        for event, name, limit in (
            ("rolls over", f"roll.{unit.name}", ROLLOVER_ANGLE),
            ("jackknifes", f"articulation.{unit.name}", JACKKNIFE_ANGLE),
        ):
            exceeded = ~(np.abs(signals.get(name, np.zeros_like(time))) < limit)
            if exceeded.any():
                raise SignalError(
                    f"{name}: expected a magnitude below {limit:g} rad; the {unit.name} {event} at"
                    f" {time[exceeded.argmax()]:.1f} s; reduce speed, steering, braking or the roughness of the road"
                )
    stopped = signals["speed"] < LOWEST_SPEED
    if stopped.any():
        raise SignalError(
            f"speed: expected {LOWEST_SPEED:g} m/s or more, the range of the tyre model; the truck is slower at"
            f" {time[stopped.argmax()]:.1f} s; choose a course with a higher speed"
        )
