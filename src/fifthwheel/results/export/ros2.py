"""States as messages of ROS 2: the velocity of the first unit with its covariance, and the articulation angles."""

import math
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from fifthwheel.data.channels import ARTICULATION, SIDESLIP, SPEED, YAW_RATE, SignalName, names_of
from fifthwheel.data.record import Record
from fifthwheel.estimate.observe import States, Status

USABLE = (Status.OK, Status.COASTING)
"""Statuses of states that become messages; a message has no status of its own."""
SPEED_SIGMA = 0.01
"""Assumed standard deviation of the measured speed as a fraction of it: of a calibrated speedometer."""
_UNKNOWN = 1e6
"""Variance of the components of a velocity that are not estimated, as usual in ROS."""
TWIST, JOINTS = "geometry_msgs/msg/TwistWithCovarianceStamped", "sensor_msgs/msg/JointState"
TOPICS = {TWIST: "/fifthwheel/velocity", JOINTS: "/fifthwheel/articulation"}
_PARTS = {
    "std_msgs/Header": "builtin_interfaces/Time stamp; string frame_id",
    "geometry_msgs/TwistWithCovariance": "geometry_msgs/Twist twist; float64[36] covariance",
    "geometry_msgs/Twist": "geometry_msgs/Vector3 linear; geometry_msgs/Vector3 angular",
    "geometry_msgs/Vector3": "float64 x; float64 y; float64 z",
}


def _definition(fields: str, *parts: str) -> str:
    """Definition of a message with those that it contains, as an MCAP file stores it."""
    blocks = [fields, *(f"MSG: {part}; {_PARTS[part]}" for part in parts)]
    return ("\n" + "=" * 80 + "\n").join(block.replace("; ", "\n") for block in blocks) + "\n"


DEFINITIONS = {
    TWIST: _definition("std_msgs/Header header; geometry_msgs/TwistWithCovariance twist", *_PARTS),
    JOINTS: _definition(
        "std_msgs/Header header; string[] name; float64[] position; float64[] velocity; float64[] effort",
        "std_msgs/Header",
    ),
}


def messages(values: Mapping[str, float], nanoseconds: int) -> dict[str, dict[str, Any]]:
    """Messages by their type, with the fields by name; those whose numbers are missing are left out.

    Axes are those of ISO 8855 and of ROS: x forwards, y to the left. The sideslip is v_y / v_x; its error and those of
    speed and yaw rate count as independent. `values` are "speed" and the states, each with "<state>.sigma", SI.
    """
    found, stamp = {}, {"sec": nanoseconds // 10**9, "nanosec": nanoseconds % 10**9}
    unit = next((SignalName.of(name).unit for name in _states(YAW_RATE, values)), "")
    slip, yaw_rate = f"{SIDESLIP.quantity}.{unit}", f"{YAW_RATE.quantity}.{unit}"
    used = [SPEED.quantity, slip, f"{slip}.sigma", yaw_rate, f"{yaw_rate}.sigma"]
    speed, beta, beta_sigma, rate, rate_sigma = (float(values.get(name, math.nan)) for name in used)
    if math.isfinite(speed + beta + beta_sigma + rate + rate_sigma):
        covariance = _UNKNOWN * np.eye(6)
        covariance[:2, :2] = (SPEED_SIGMA * speed) ** 2 * np.outer((1.0, beta), (1.0, beta))
        covariance[1, 1] += (speed * beta_sigma) ** 2
        covariance[5, 5] = rate_sigma**2
        linear, angular = {"x": speed, "y": speed * beta, "z": 0.0}, {"x": 0.0, "y": 0.0, "z": rate}
        found[TWIST] = {
            "header": {"stamp": stamp, "frame_id": unit},
            "twist": {"twist": {"linear": linear, "angular": angular}, "covariance": covariance.ravel().tolist()},
        }
    joints = _states(ARTICULATION, values)
    angles = [float(values[name]) for name in joints]
    if joints and all(map(math.isfinite, angles)):
        rates = np.diff([values[name] for name in _states(YAW_RATE, values)]).tolist()
        found[JOINTS] = {
            "header": {"stamp": stamp, "frame_id": ""},
            "name": joints,
            "position": angles,
            "velocity": rates if len(rates) == len(joints) else [],
            "effort": [],
        }
    return found


def _states(channel: Any, values: Mapping[str, Any]) -> list[str]:
    return [name for name in names_of(channel, values) if not name.endswith(".sigma")]


def write_samples(samples: Iterable[tuple[float, Mapping[str, float]]], path: Path) -> None:
    """Write the messages of samples, time in s and values as of `messages`, to an MCAP file."""
    from mcap_ros2.writer import Writer

    with path.open("wb") as file, Writer(file) as writer:
        schemas = {kind: writer.register_msgdef(kind, definition) for kind, definition in DEFINITIONS.items()}
        for time, values in samples:
            nanoseconds = max(0, round(time * 1e9))
            for kind, message in messages(values, nanoseconds).items():
                writer.write_message(TOPICS[kind], schemas[kind], message, nanoseconds)


def write_mcap(states: States, record: Record, path: Path) -> None:
    """Write the `USABLE` states of a record, whose speed is that of the velocity."""
    columns = {SPEED.quantity: record.signals[SPEED.quantity], **states.values}
    columns |= {f"{name}.sigma": sigma for name, sigma in states.sigma.items()}
    table = np.column_stack([states.time, *columns.values()])
    rows = (table[k].tolist() for k in np.flatnonzero(np.isin(states.status, USABLE)))
    write_samples(((time, dict(zip(columns, values, strict=True))) for time, *values in rows), path)
