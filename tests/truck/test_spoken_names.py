"""Spoken names: every kind of path has plain words, in a table and in a sentence."""

import pytest

from fifthwheel.truck import get, names
from fifthwheel.truck.spoken_names import named, spoken


@pytest.mark.parametrize(
    ("path", "in_table", "in_sentence"),
    [
        (
            "tractor.front.cornering_stiffness",
            "Front tyres, cornering stiffness",
            "cornering stiffness of the front tyres",
        ),
        ("semitrailer.yaw_inertia", "Trailer, yaw inertia", "yaw inertia of the trailer"),
        ("semitrailer.payload.height", "Trailer payload, height", "height of the trailer payload"),
        ("tractor.drive.tyre_roll_stiffness", "Drive tyres, roll stiffness", "roll stiffness of the drive tyres"),
        (
            "semitrailer.rear.roll_damping",
            "Trailer rear suspension, roll damping",
            "roll damping of the trailer rear suspension",
        ),
        ("tractor.sprung.cog_height", "Tractor body, CoG height", "CoG height of the tractor body"),
        ("first.cog", "First trailer, CoG position", "CoG position of the first trailer"),
        ("road.friction", "Road, friction", "friction of the road"),
        ("mass_scale", "Scale of all masses", "scale of all masses"),
        ("load_transfer.tractor.drive", "Drive axle, load transfer", "load transfer of the drive axle"),
        ("steer.tractor.front.gain", "Front axle, steer angle gain", "steer angle gain of the front axle"),
        ("yaw_rate.tractor.offset@bend", "Tractor, yaw rate offset, bend", "yaw rate offset of the tractor in bend"),
    ],
)
def test_a_path_in_words(path, in_table, in_sentence):
    assert spoken(path) == in_table
    assert named(path) == f"the {in_sentence}"


def test_no_parameter_of_a_vehicle_shares_its_name_or_has_a_path_in_it():
    for truck in names():
        words = [spoken(path) for path in get(truck).parameters()]
        assert len(set(words)) == len(words)
        assert not [name for name in words if "_" in name or "." in name]
