"""The examples of own estimators, on short runs: against each other where they must agree, and with the truth."""

import importlib
import re
import runpy
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import fifthwheel as fw
from fifthwheel.apps.studies.scenarios import simulated

EXAMPLES = Path(__file__).parents[1] / "examples"
TRUCK = fw.vehicle("cheng_cebon_2011")
SHORT = fw.SimulatedRun(manoeuvre="sweep", duration=2.5)


@pytest.fixture(scope="module")
def example():
    """Imports an example by name."""
    pytest.importorskip("filterpy")
    sys.path.insert(0, str(EXAMPLES))
    yield importlib.import_module
    sys.path.remove(str(EXAMPLES))


@pytest.fixture(scope="module")
def record() -> fw.Record:
    return simulated(TRUCK, SHORT).record(1)


EXTENSIONS = (EXAMPLES.parent / "docs" / "howto" / "extend.md").read_text(encoding="utf-8")


def test_the_page_on_extensions_shows_the_examples() -> None:
    shown = re.findall(r"```python\n(def .*?)```", EXTENSIONS, re.DOTALL)
    for code, name in zip(shown, ("tyre_laws", "actuator_lag", "optical_sensor"), strict=True):
        assert code in (EXAMPLES / f"{name}.py").read_text(encoding="utf-8")


@pytest.mark.slow
def test_the_page_on_extensions_shows_what_an_example_prints() -> None:
    done = subprocess.run([sys.executable, EXAMPLES / "actuator_lag.py"], capture_output=True, text=True, check=True)
    assert done.stdout in EXTENSIONS


def test_the_posterior_in_jax() -> None:
    pytest.importorskip("jax")
    names = runpy.run_path(str(EXAMPLES / "posterior_in_jax.py"))
    assert names["value"] == names["density"](names["x"])
    assert (names["gradient"] == names["density"].gradient(names["x"])).all()


@pytest.mark.slow
def test_with_known_parameters_both_are_the_kalman_filter(example, record) -> None:
    unscented = example("unscented_filter").UnscentedFilter(prior=1e-6)(record, TRUCK).states
    particle = example("particle_filter").ParticleFilter(particles=1, prior=0.0)(record, TRUCK).states
    assert unscented.keys() == particle.keys()
    assert isinstance(example("unscented_filter").UnscentedFilter(), fw.Estimator)
    for name, values in unscented.items():
        assert particle[name] == pytest.approx(values, abs=1e-5 * np.abs(values).max() + 1e-9), name


@pytest.mark.slow
def test_comparison(example, capsys, monkeypatch) -> None:
    module = example("compare")
    monkeypatch.setattr(module, "LANE_CHANGES", {"short": SHORT})
    particle = example("particle_filter").ParticleFilter(particles=10)
    rows = module.compare({"own": particle}, seeds=1, jobs=1)
    assert [row["estimator"].split(",")[0] for row in rows] == ["Kalman filter"] * 2 + ["own", "one stage"]
    assert rows[0]["sideslip"] < rows[1]["sideslip"]
    assert len(capsys.readouterr().out.splitlines()) == 5


@pytest.mark.slow
def test_the_node_of_ros_2_gives_the_states_of_the_record(example, record: fw.Record, tmp_path: Path) -> None:
    """Messages of sensors as mcap_ros2 decodes them; what the node publishes, encoded and decoded again."""
    writer = pytest.importorskip("mcap_ros2.writer")
    from mcap.reader import make_reader
    from mcap_ros2.decoder import DecoderFactory

    from fifthwheel.results.export.ros2 import DEFINITIONS, JOINTS, TOPICS, TWIST

    node = example("ros2_node")
    _, _, vector = DEFINITIONS[TWIST].rpartition("MSG: geometry_msgs/Vector3")
    more = "=" * 80 + "\nMSG: geometry_msgs/Vector3" + vector
    twist = (
        "=" * 80 + "\nMSG: geometry_msgs/Twist\ngeometry_msgs/Vector3 linear\ngeometry_msgs/Vector3 angular\n" + more
    )
    definitions = {
        "sensor_msgs/msg/Imu": "geometry_msgs/Vector3 angular_velocity\n" + more,
        "geometry_msgs/msg/TwistStamped": "geometry_msgs/Twist twist\n" + twist,
        JOINTS: DEFINITIONS[JOINTS],
    }

    def decoded(path: Path) -> list[tuple[int, str, object]]:
        with path.open("rb") as file:
            messages = make_reader(file, decoder_factories=[DecoderFactory()]).iter_decoded_messages()
            return [(message.log_time, channel.topic, content) for _, channel, message, content in messages]

    record = record.cut(0, 1.5)
    with (tmp_path / "sensors.mcap").open("wb") as file, writer.Writer(file) as sensors:
        schemas = {kind: sensors.register_msgdef(kind, text) for kind, text in definitions.items()}
        for k, time in enumerate(record.time.tolist()):
            now = {name: values[k] for name, values in record.signals.items()}
            for topic, (kind, _) in node.SENSORS.items():
                unit = topic.split("/")[1]
                message = {
                    "angular_velocity": {"x": now[f"roll_rate.{unit}"], "z": now[f"yaw_rate.{unit}"]},
                    "twist": {"linear": {"x": now["speed"]}},
                    "position": [now["steer.tractor.front"]],
                }
                sensors.write_message(topic, schemas[kind], message, 10**18 + round(time * 1e9))
    estimator, last = node.Estimator(TRUCK), 0
    with (tmp_path / "states.mcap").open("wb") as file, writer.Writer(file) as published:
        schemas = {kind: published.register_msgdef(kind, text) for kind, text in DEFINITIONS.items()}
        for at, topic, message in [*decoded(tmp_path / "sensors.mcap"), (2 * 10**18, "", None)]:
            if last and at > last:
                for kind, fields in estimator.step(last).items():
                    published.write_message(TOPICS[kind], schemas[kind], fields, last)
            last = at
            if topic:
                estimator.receive(topic, message)
    found = decoded(tmp_path / "states.mcap")
    states = fw.Observer(TRUCK, node.SIGNALS).batch(record)
    usable = np.isin(states.status, (fw.Status.OK, fw.Status.COASTING))
    assert usable.sum() > 100
    velocity = [m.twist.twist for _, topic, m in found if topic == TOPICS[TWIST]]
    np.testing.assert_allclose([v.angular.z for v in velocity], states.values["yaw_rate.tractor"][usable], atol=1e-6)
    slip = [v.linear.y / v.linear.x for v in velocity]
    np.testing.assert_allclose(slip, states.values["sideslip.tractor"][usable], atol=1e-6)
    angles = [m.position[0] for _, topic, m in found if topic == TOPICS[JOINTS]]
    np.testing.assert_allclose(angles, states.values["articulation.semitrailer"][usable], atol=1e-6)
