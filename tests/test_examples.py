"""The examples of own estimators, on short runs: against each other where they must agree, and with the truth."""

import importlib
import re
import runpy
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import fifthwheel as fw
from fifthwheel.apps.studies.scenarios import simulated
from fifthwheel.results.export.ros2 import JOINTS, TWIST

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
def test_the_node_of_ros_2_gives_the_states_of_the_record(example, record: fw.Record) -> None:
    """Messages as ROS gives them; how states are encoded: `tests/results/export/test_ros2.py`."""
    node, record = example("ros2_node"), record.cut(0, 1.5)
    estimator, found = node.Estimator(TRUCK), []
    for k, time in enumerate(record.time.tolist()):
        now = {name: values[k] for name, values in record.signals.items()}
        for topic in node.SENSORS:
            unit = topic.split("/")[1]
            rate = SimpleNamespace(x=now[f"roll_rate.{unit}"], z=now[f"yaw_rate.{unit}"])
            twist = SimpleNamespace(linear=SimpleNamespace(x=now["speed"]))
            position = [now["steer.tractor.front"]]
            estimator.receive(topic, SimpleNamespace(angular_velocity=rate, twist=twist, position=position))
        found += filter(None, [estimator.step(10**18 + round(time * 1e9))])
    states = fw.Observer(TRUCK, node.SIGNALS).batch(record)
    usable = np.isin(states.status, (fw.Status.OK, fw.Status.COASTING))
    assert usable.sum() > 100
    velocity = [message[TWIST]["twist"]["twist"] for message in found]
    expected = {name: values[usable] for name, values in states.values.items()}
    np.testing.assert_allclose([v["angular"]["z"] for v in velocity], expected["yaw_rate.tractor"], atol=1e-6)
    slip = [v["linear"]["y"] / v["linear"]["x"] for v in velocity]
    np.testing.assert_allclose(slip, expected["sideslip.tractor"], atol=1e-6)
    angles = [message[JOINTS]["position"][0] for message in found]
    np.testing.assert_allclose(angles, expected["articulation.semitrailer"], atol=1e-6)
