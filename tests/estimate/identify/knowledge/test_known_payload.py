"""A log with a known payload, and a later one with an unknown payload."""

from dataclasses import replace

import pytest

import fifthwheel as fw
from fifthwheel.estimate.identify import OneStage
from fifthwheel.truck import Vehicle

LINEAR = OneStage(tyres="linear")
HEIGHT, STIFFNESS = "semitrailer.payload.height", "semitrailer.roll_stiffness"


@pytest.fixture(scope="module")
def assumed(truck: Vehicle) -> Vehicle:
    """The truck with a suspension in its file that is stiffer than the real one, at a higher roll axis."""
    values = truck.parameters()
    return truck.replace({STIFFNESS: 1.12 * values[STIFFNESS], "semitrailer.roll_axis_height": 0.88})


def test_a_known_payload_makes_the_next_payload_height_more_accurate(truck: Vehicle, assumed: Vehicle) -> None:
    """The known one has the same mass, and a height of 0.8 m."""
    low, record = fw.simulate(truck.replace({HEIGHT: 0.8}), count=1, seed=3), fw.simulate(truck, count=1, seed=4)
    settings = replace(LINEAR, given={HEIGHT: "0.8 m exact"})
    known = fw.identify([low], assumed, settings, occasion=fw.Occasion(load="a"))
    alone = fw.identify([record], assumed, LINEAR)[HEIGHT]
    after = fw.identify([record], assumed, LINEAR, knowledge=known.knowledge, occasion=fw.Occasion(load="b"))[HEIGHT]
    true = truck.parameters()[HEIGHT]
    assert abs(alone.value / true - 1) > 0.09
    assert abs(after.value / true - 1) < 0.08
    assert after.sigma < 0.7 * alone.sigma
    assert after.verdict == "converged"


def test_the_cog_height_of_the_unladen_body_is_that_of_both(truck: Vehicle, assumed: Vehicle) -> None:
    """It is uncertain with a payload of unknown height too, as its file states."""
    name = "semitrailer.sprung.cog_height"
    stated = assumed.with_stated({**assumed.stated, name: 0.02})
    result = fw.identify([fw.simulate(truck, count=1, seed=4)], stated, LINEAR)
    (found,) = (number for number in result.uncertain if number.name == name)
    assert found.prior == pytest.approx(0.02, rel=0.01)
