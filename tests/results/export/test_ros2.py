"""Messages of ROS 2: written by mcap_ros2, decoded by it again; their covariance against random errors."""

import math
from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("mcap_ros2")
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

import fifthwheel as fw
from fifthwheel.results.export.ros2 import JOINTS, SPEED_SIGMA, TOPICS, TWIST, messages, write_mcap

VALUES = {
    "speed": 20.0,
    "sideslip.tractor": -0.02,
    "sideslip.tractor.sigma": 0.003,
    "sideslip.semitrailer": 0.05,
    "sideslip.semitrailer.sigma": 0.01,
    "yaw_rate.tractor": 0.1,
    "yaw_rate.tractor.sigma": 0.002,
    "yaw_rate.semitrailer": 0.07,
    "yaw_rate.semitrailer.sigma": 0.004,
    "articulation.semitrailer": -0.2,
    "articulation.semitrailer.sigma": 0.01,
}


def decoded(path: Path) -> dict[str, list[tuple[int, Any]]]:
    """Time in ns and message, by topic."""
    found = defaultdict(list)
    with path.open("rb") as file:
        for _, channel, message, content in make_reader(
            file, decoder_factories=[DecoderFactory()]
        ).iter_decoded_messages():
            found[channel.topic].append((message.log_time, content))
    return found


def test_velocity_and_its_covariance() -> None:
    message = messages(VALUES, 1_700_000_000_250_000_000)[TWIST]
    assert message["header"] == {"stamp": {"sec": 1_700_000_000, "nanosec": 250_000_000}, "frame_id": "tractor"}
    twist = message["twist"]["twist"]
    assert (twist["linear"]["x"], twist["linear"]["y"], twist["angular"]["z"]) == (20.0, -0.4, 0.1)
    random = np.random.default_rng(1)
    speed = 20.0 * (1 + SPEED_SIGMA * random.standard_normal(400_000))
    lateral = speed * (-0.02 + 0.003 * random.standard_normal(400_000))
    covariance = np.reshape(message["twist"]["covariance"], (6, 6))
    np.testing.assert_allclose(covariance[:2, :2], np.cov(speed, lateral), rtol=0.03, atol=1e-4)
    assert covariance[5, 5] == pytest.approx(0.002**2)
    assert np.diag(covariance)[2:5].tolist() == [1e6] * 3
    np.testing.assert_array_equal(covariance, covariance.T)


def test_articulation_and_its_rate() -> None:
    joints = messages(VALUES, 0)[JOINTS]
    assert (joints["name"], joints["position"]) == (["articulation.semitrailer"], [-0.2])
    assert joints["velocity"] == pytest.approx([-0.03])


@pytest.mark.parametrize("missing", ["speed", "sideslip.tractor", "yaw_rate.tractor.sigma"])
def test_no_velocity_where_a_number_is_missing(missing: str) -> None:
    assert list(messages(VALUES | {missing: math.nan}, 0)) == [JOINTS]
    assert list(messages({name: v for name, v in VALUES.items() if not name.startswith(missing)}, 0)) == [JOINTS]


@pytest.mark.slow
def test_a_file_has_the_valid_states(tmp_path: Path) -> None:
    truck = fw.vehicle("cheng_cebon_2011")
    record = fw.simulate(truck, count=1, seed=1)
    states = fw.Observer(truck, record.signals).batch(record)
    write_mcap(states, record, tmp_path / "a.mcap")
    found = decoded(tmp_path / "a.mcap")
    usable = np.isin(states.status, (fw.Status.OK, fw.Status.COASTING))
    assert 0 < usable.sum() < len(record)
    for topic in TOPICS.values():
        assert [time for time, _ in found[topic]] == np.round(states.time[usable] * 1e9).astype(int).tolist()
    velocity = [message for _, message in found[TOPICS[TWIST]]]
    assert velocity[0].header.frame_id == "tractor"
    slip = [m.twist.twist.linear.y / m.twist.twist.linear.x for m in velocity]
    np.testing.assert_allclose(slip, states.values["sideslip.tractor"][usable], rtol=1e-12)
    sigma = [math.sqrt(m.twist.covariance[35]) for m in velocity]
    np.testing.assert_allclose(sigma, states.sigma["yaw_rate.tractor"][usable], rtol=1e-12)
    angles = [message.position[0] for _, message in found[TOPICS[JOINTS]]]
    np.testing.assert_array_equal(angles, states.values["articulation.semitrailer"][usable])
