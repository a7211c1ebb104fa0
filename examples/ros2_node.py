"""A node of ROS 2: messages of sensors in, velocity with covariance and articulation angles out, 100 per second.

Run it in a shell in which ROS 2 is set up, with the vehicle file: python ros2_node.py truck.toml
"""

import sys
from collections.abc import Callable
from functools import partial
from typing import Any

import fifthwheel as fw
from fifthwheel.results.export.ros2 import TOPICS, USABLE, messages

PERIOD = 0.01  # s


def gyro(unit: str, message: Any) -> dict[str, float]:
    """Signals of a unit from sensor_msgs/Imu, mounted with x forwards and z upwards."""
    rate = message.angular_velocity
    return {f"yaw_rate.{unit}": rate.z, f"roll_rate.{unit}": rate.x}


SENSORS: dict[str, tuple[str, Callable[[Any], dict[str, float]]]] = {
    "/tractor/imu": ("sensor_msgs/msg/Imu", partial(gyro, "tractor")),
    "/semitrailer/imu": ("sensor_msgs/msg/Imu", partial(gyro, "semitrailer")),
    "/tractor/wheel_velocity": ("geometry_msgs/msg/TwistStamped", lambda m: {"speed": m.twist.linear.x}),
    "/tractor/steering": ("sensor_msgs/msg/JointState", lambda m: {"steer.tractor.front": m.position[0]}),
}
"""Type of the messages of a topic, and the signals in one; change them to those of your truck."""
SIGNALS = (
    "speed",
    "steer.tractor.front",
    *(f"{q}.{u}" for q in ("yaw_rate", "roll_rate") for u in ("tractor", "semitrailer")),
)


class Estimator:
    """Messages of sensors to messages of states, without ROS."""

    def __init__(self, vehicle: fw.Vehicle) -> None:
        self._observer, self._sample, self._speed = fw.Observer(vehicle, SIGNALS), dict[str, float](), float("nan")

    def receive(self, topic: str, message: Any) -> None:
        """Take the signals of a message into the next sample."""
        self._sample |= SENSORS[topic][1](message)
        self._speed = self._sample.get("speed", self._speed)

    def step(self, nanoseconds: int) -> dict[str, dict[str, Any]]:
        """Messages of the states now, as dictionaries by their type; none where the states are not valid."""
        answer = self._observer.push({"time": nanoseconds * 1e-9, **self._sample})
        self._sample = {}  # a sensor that sends nothing is missing, and not constant
        return messages(answer | {"speed": self._speed}, nanoseconds) if answer["status"] in USABLE else {}


def main(vehicle: str) -> None:
    """Subscribe to the sensors, and publish the states until Ctrl-C."""
    import rclpy
    from rosidl_runtime_py.set_message import set_message_fields
    from rosidl_runtime_py.utilities import get_message

    rclpy.init()
    node, estimator = rclpy.create_node("fifthwheel"), Estimator(fw.Vehicle.load(vehicle))
    for topic, (kind, _) in SENSORS.items():
        node.create_subscription(get_message(kind), topic, partial(estimator.receive, topic), 10)
    publishers = {kind: node.create_publisher(get_message(kind), topic, 10) for kind, topic in TOPICS.items()}

    def publish() -> None:
        for kind, fields in estimator.step(node.get_clock().now().nanoseconds).items():
            message = get_message(kind)()
            set_message_fields(message, fields)
            publishers[kind].publish(message)

    node.create_timer(PERIOD, publish)
    rclpy.spin(node)


if __name__ == "__main__":
    main(sys.argv[1])
