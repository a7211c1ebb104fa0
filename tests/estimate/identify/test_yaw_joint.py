"""The damper in the joint of a bus: stated, and not stated, in which case the doubt names it."""

import os
import re
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import cont2discrete, dlsim

import fifthwheel as fw
from fifthwheel.estimate.identify.doubts import DoubtKind
from fifthwheel.estimate.identify.given import applied
from fifthwheel.estimate.identify.unknowns.parameters import one_stage_unknowns
from fifthwheel.results.diagnose.doubt_cautions import describe_cause
from tests.model.dynamics.test_yaw_joint import newton_euler

PATH = "joint.yaw_damping"
BUS = fw.vehicle("articulated_bus")
FREE = fw.Vehicle.loads(BUS.to_toml().replace('yaw_damping = "30000.0 N m s/rad"', ""))
LINEAR = fw.OneStage(tyres="linear")
NO_LAG = {f"{path}.relaxation_length": 0.0 for path in BUS.group_paths()} | {
    f"{unit.name}.roll_axis_height": 0.01 for unit in BUS.units
}
CASE = Path(os.environ.get("FIFTHWHEEL_DATA", Path(__file__).parents[4] / "shared" / "data")).parent
CASE = CASE / "cases" / "yaw_joint_damper"
"""Input that is not part of the project."""


def unknowns(truck: fw.Vehicle, **given: str) -> dict[str, tuple[float, float, float]]:
    """Prior mean, sigma and lower bound of the yaw stiffness and damping."""
    settings = fw.OneStage(given={f"joint.{name}": text for name, text in given.items()})
    truck, settings = applied(truck, settings)
    found = one_stage_unknowns(truck, ["yaw_rate.front"], settings)
    return {u.name: (u.centre, u.scale, u.lower) for u in found if u.name.startswith("joint.yaw")}


def test_a_joint_is_uncertain_as_stated() -> None:
    assert unknowns(FREE) == {PATH: (0.0, 2e3, 0.0)}
    assert unknowns(FREE, yaw_damping="20 kN m s/rad +- 50 %") == {PATH: (20e3, 10e3, 0.0)}
    assert unknowns(FREE, yaw_damping="+- 5 kN m s/rad") == {PATH: (0.0, 5e3, 0.0)}
    assert unknowns(BUS) == {PATH: (30e3, pytest.approx(9e3), 0.0)}
    assert unknowns(BUS, yaw_damping="exact") == unknowns(FREE, yaw_damping="exact") == {}
    assert unknowns(BUS.with_stated(dict.fromkeys(BUS.parameters(), 0.0))) == {}
    stiff = unknowns(BUS, yaw_stiffness="5 kN m/rad +- 20 %", yaw_damping="exact")
    assert stiff == {"joint.yaw_stiffness": (5e3, pytest.approx(1e3), 0.0)}


def driven(damping: float) -> fw.Record:
    """A log of the yaw rates of a bus in the plane, without roll and lag of the tyres."""
    speed, dt, rng = 9.0, 0.05, np.random.default_rng(4)
    truth = BUS.replace({PATH: damping})
    time = np.arange(0.0, 60.0, dt)
    steer = 0.04 * np.sin(2 * np.pi * 0.13 * time) + 0.03 * np.sin(2 * np.pi * 0.37 * time + 1.0)
    A, B = newton_euler(truth, speed)
    rates = np.eye(4)[1:3]
    _, y, _ = dlsim((*cont2discrete((A, B, rates, np.zeros((2, 1))), dt, "foh")[:4], dt), steer[:, None])
    y += rng.normal(scale=0.003, size=y.shape)
    signals = {"speed": np.full(len(time), speed), "steer.front.steer": steer}
    return fw.Record(time=time, signals=signals | {"yaw_rate.front": y[:, 0], "yaw_rate.rear": y[:, 1]})


def blamed(result: fw.Identification) -> list[str]:
    return [c.name for d in result.doubts if d.kind is DoubtKind.ASSUMPTION for c in d.causes]


@pytest.mark.slow
def test_a_log_contradicts_a_free_joint() -> None:
    """Where the file has the damper, nothing is contradicted."""
    record = driven(60e3)
    free, stated = (truck.replace(NO_LAG) for truck in (FREE, BUS.replace({PATH: 50e3})))
    doubtful = fw.identify([record], free, LINEAR)
    assert blamed(doubtful) == [PATH]
    (doubt,) = [d for d in doubtful.doubts if d.kind is DoubtKind.ASSUMPTION]
    assert doubt.causes[0].changes[PATH] == pytest.approx(60e3, rel=0.2)
    words = describe_cause(doubt.causes[0], free)
    line = re.search(r'^joint is not free in yaw: give it (yaw_damping = ".*") in the vehicle file', words)
    assert line
    file = free.to_toml().replace('name = "joint"', f'name = "joint"\n{line[1]}')
    assert fw.Vehicle.loads(file).parameters()[PATH] == pytest.approx(doubt.causes[0].changes[PATH], rel=1e-2)
    assert blamed(fw.identify([record], stated, LINEAR)) == []


@pytest.mark.slow
@pytest.mark.skipif(not CASE.is_dir(), reason="the case is not present")
def test_the_case() -> None:
    record = fw.read_log(CASE / "log.csv")
    assert blamed(fw.identify([record], fw.Vehicle.load(CASE / "without.toml"))) == ["turntable.yaw_damping"]
    stated = fw.identify([record], fw.Vehicle.load(CASE / "bus.toml"))
    assert blamed(stated) == []
    truth = stated.initial_vehicle.parameters()
    errors = [abs(e.value - truth[e.name]) / e.sigma for e in stated.parameters if e.name in truth]
    assert max(errors) < 2.5
