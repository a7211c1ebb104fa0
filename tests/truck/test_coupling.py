"""Kinds of couplings: what they carry, and the static loads that follow."""

import pytest

from fifthwheel.base.errors import VehicleError
from fifthwheel.base.units import STANDARD_GRAVITY as GRAVITY
from fifthwheel.truck import Coupling, Vehicle, get

PLACE = {"leading_position": -3.0, "trailing_position": 0.0, "height": 0.6}


def test_a_drawbar_eye_is_free_in_roll() -> None:
    eye = Coupling(name="eye", kind="drawbar_eye", **PLACE)
    assert (eye.roll_stiffness, eye.roll_damping) == (0.0, 0.0)
    with pytest.raises(VehicleError, match=r"eye.roll_stiffness: expected 0 for a drawbar eye.*give another kind"):
        Coupling(name="eye", kind="drawbar_eye", roll_stiffness=1e6, **PLACE)


def test_other_kinds_need_a_roll_stiffness() -> None:
    with pytest.raises(VehicleError, match=r"fifth_wheel.roll_stiffness|roll_stiffness: expected a value"):
        Coupling(**PLACE)


def test_a_turntable_belongs_to_a_dolly_with_a_drawbar() -> None:
    vehicle = get("truck_full_trailer")
    eye, turntable = vehicle.couplings
    wheel = eye.model_copy(update={"kind": "fifth_wheel", "roll_stiffness": 3e6})
    with pytest.raises(VehicleError, match=r"turntable.kind: expected a drawbar_eye in front"):
        Vehicle(name="wrong", units=vehicle.units, couplings=(wheel, turntable))


def shifted(distance: float) -> Vehicle:
    """The truck with full trailer, its turntable ahead of the axle of the dolly by a distance, m."""
    vehicle = get("truck_full_trailer")
    return vehicle.replace({"turntable.leading_position": vehicle.couplings[1].leading_position + distance})


@pytest.mark.parametrize("distance", [0.0, 0.3])
def test_dolly_and_full_trailer_carry_their_weight_alone(distance: float) -> None:
    """The hinged drawbar carries no vertical load: forces and moments of dolly and body balance without it."""
    vehicle = shifted(distance)
    truck, dolly, trailer = vehicle.units
    loads = vehicle.axle_loads()
    assert loads["truck.front"] + loads["truck.drive"] == pytest.approx(truck.mass * GRAVITY, rel=1e-12)
    assert loads["dolly"] + loads["trailer"] == pytest.approx((dolly.mass + trailer.mass) * GRAVITY, rel=1e-12)
    origin = vehicle.couplings[1].leading_position  # of the body on the dolly
    weight = GRAVITY * (dolly.mass * dolly.cog + trailer.mass * (origin + trailer.cog))
    support = loads["dolly"] * dolly.axles[0].position + loads["trailer"] * (origin + trailer.axles[0].position)
    assert support == pytest.approx(weight, rel=1e-12)


def test_an_ordinary_fifth_wheel_on_a_dolly_loads_the_drawbar() -> None:
    vehicle = get("truck_dolly_semitrailer")
    loads = vehicle.axle_loads()
    on_truck = loads["truck.front"] + loads["truck.drive"] - vehicle.units[0].mass * GRAVITY
    dolly, semitrailer = vehicle.units[1:]
    kingpin = semitrailer.mass * GRAVITY - loads["semitrailer"]
    # moments of the dolly about its axles: fifth wheel 0.1 m and CoG ahead of them
    expected = (kingpin * 0.1 + dolly.mass * GRAVITY * (dolly.cog + 4.3)) / 4.3
    assert on_truck == pytest.approx(expected, rel=1e-9)


def test_a_vehicle_file_keeps_the_kinds() -> None:
    vehicle = get("truck_full_trailer")
    assert [c.kind for c in vehicle.couplings] == ["drawbar_eye", "turntable"]
    assert Vehicle.loads(vehicle.to_toml()) == vehicle


def test_a_class_gives_the_kind() -> None:
    vehicle = Vehicle.loads(
        """
        name = "drawbar"
        [[unit]]
        name = "truck"
        class = "truck_4x2"
        mass = "16 t"
        axle_group = [{ name = "front", position = "0 m" }, { name = "drive", position = "-5 m" }]
        [unit.payload]
        [[unit]]
        name = "dolly"
        class = "dolly"
        axle_group = [{ position = "-2.8 m" }]
        [[unit]]
        name = "trailer"
        class = "full_trailer"
        mass = "14 t"
        axle_group = [{ position = "-5 m" }]
        [unit.payload]
        [[coupling]]
        name = "drawbar"
        leading_position = "-6.5 m"
        [[coupling]]
        name = "ring"
        leading_position = "-2.8 m"
        """
    )
    assert [c.kind for c in vehicle.couplings] == ["drawbar_eye", "turntable"]
    loads = vehicle.axle_loads()
    assert loads["truck.front"] + loads["truck.drive"] == pytest.approx(16000 * GRAVITY)
    assert vehicle.parameters()["dolly.cornering_stiffness"] == pytest.approx(5.7 * loads["dolly"], rel=1e-6)
