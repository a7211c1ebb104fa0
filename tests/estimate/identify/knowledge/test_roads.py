"""Logs on one road share its friction."""

from dataclasses import replace

import pytest

import fifthwheel as fw
from tests.estimate.identify.test_saturating_tyres import response

FRICTION, TRUE = "road.friction", 0.3
SETTINGS = fw.OneStage(tyres="saturating", check=False)


@pytest.fixture(scope="module")
def knowledge(tmp_path_factory: pytest.TempPathFactory) -> fw.Knowledge:
    """Of a sine on snow, as a file keeps it."""
    occasion, path = fw.Occasion(road="pass"), tmp_path_factory.mktemp("known") / "knowledge.json"
    first = response(1.5, TRUE, name="first")
    result = fw.identify([first], fw.vehicle("cheng_cebon_2011"), SETTINGS, occasion=occasion)
    result.knowledge.save(path)
    return fw.Knowledge.load(path)


def test_the_friction_belongs_to_a_named_road_alone(knowledge: fw.Knowledge) -> None:
    """A weak sine begins with it on the same road, and not on another one."""
    (log,) = knowledge.logs
    assert (log.road, log.trailer, log.load) == ("pass", "", "")
    assert FRICTION in log.information.names
    weak, truck = response(0.4, TRUE, name="second", seed=2), fw.vehicle("cheng_cebon_2011")
    same, other, unnamed = (
        fw.identify([weak], truck, SETTINGS, knowledge=knowledge, occasion=fw.Occasion(road=road))
        for road in ("pass", "valley", "")
    )
    assert same[FRICTION].sigma < 0.8 * other[FRICTION].sigma
    assert abs(same[FRICTION].value - TRUE) < 3 * same[FRICTION].sigma
    assert other[FRICTION].sigma == pytest.approx(unnamed[FRICTION].sigma, rel=1e-5)
    assert FRICTION not in unnamed.knowledge.logs[1].information.names


def test_two_trucks_share_the_road_alone(knowledge: fw.Knowledge) -> None:
    (log,) = knowledge.logs
    both = knowledge.merged(fw.Knowledge(logs=(replace(log, tractor="lorry", name="lorry", digest="other"),)))
    names = [unknown.name for unknown in both.combined.layout.unknowns]
    assert {name for name in names if names.count(name) == 1} == {FRICTION}
    elsewhere = fw.Knowledge(logs=(replace(log, tractor="lorry", road="valley"),))
    with pytest.raises(fw.SignalError, match="lorry: the first unit of another truck than tractor"):
        knowledge.merged(elsewhere)
    with pytest.raises(fw.VehicleError, match="tractor: the knowledge is of a truck whose first unit is lorry"):
        elsewhere.require_same_truck(fw.vehicle("cheng_cebon_2011"), fw.Occasion(road="pass"))
    elsewhere.require_same_truck(fw.vehicle("cheng_cebon_2011"), fw.Occasion(road="valley"))
