"""The table [driveline] of a vehicle file."""

import pytest

import fifthwheel as fw
from fifthwheel.truck import changes
from fifthwheel.truck.driveline import DRIVELINE, driveline_numbers

TEXT = fw.vehicle("cheng_cebon_2011").to_toml()


def with_driveline(text):
    return fw.Vehicle.loads(f"{TEXT}\n[driveline]\n{text}\n")


def test_numbers_of_the_file_replace_the_figures():
    truck = with_driveline('efficiency = "0.93 +- 0.5 %"\ndrag_area = "5 m^2"')
    numbers = driveline_numbers(truck.driveline, truck.stated)
    assert numbers["efficiency"] == pytest.approx((0.93, 0.00465))
    assert numbers["drag_area"] == pytest.approx((5.0, 0.75))  # 15 % as the figure
    assert numbers["engine_inertia"] == DRIVELINE["engine_inertia"][:2]
    assert truck.parameters()["driveline.drag_area"] == 5.0
    assert fw.Vehicle.loads(truck.to_toml()) == truck


def test_the_lateral_motion_does_not_depend_on_it():
    truck = with_driveline('efficiency = "0.93 +- 0.5 %"')
    plain = fw.Vehicle.loads(TEXT)
    assert [c.slopes for c in changes(truck)] == [c.slopes for c in changes(plain)]
    first, second = (fw.simulate(v, count=1, seed=1) for v in (truck, plain))
    assert first == second


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("eficiency = 0.9", r"driveline\.eficiency: no such key; did you mean .*efficiency"),
        (
            "launch_speed = 200\ngoverned_speed = 199",
            r"driveline\.launch_speed: expected less than governed_speed, 199 r",
        ),
        ("lowest_gear = 2\nhighest_gear = 2", r"driveline\.highest_gear: expected less than lowest_gear, 2, got 2; c"),
        ("efficiency = 95", r"driveline\.efficiency: expected 0\.7 to 1, the range"),
    ],
)
def test_wrong_numbers_are_refused(text, message):
    with pytest.raises(fw.VehicleError, match=message):
        with_driveline(text)
