"""Raised, self-steering and command-steered axles, and kinds of couplings: files, and the static loads that follow."""

import pytest

from fifthwheel.base.errors import VehicleError
from fifthwheel.base.units import STANDARD_GRAVITY
from fifthwheel.base.units import STANDARD_GRAVITY as GRAVITY
from fifthwheel.model.dynamics.model import topology
from fifthwheel.truck import Coupling, Vehicle, catalogue, changes, get

TEXT = catalogue.text("cheng_cebon_2011")
REAR = '{ name = "rear", position = "-9.3 m", steerable = true }'
FRONT = '{ name = "front", position = "-6.7 m", steerable = true }'


def with_rear(keys: str, front: str = "steerable = true") -> str:
    """The catalogue's file with other keys of the first and the last axle of the trailer."""
    text = TEXT.replace(REAR, f'{{ name = "rear", position = "-9.3 m", {keys} }}')
    return text.replace(FRONT, f'{{ name = "front", position = "-6.7 m", {front} }}')


def test_a_file_states_how_axles_steer():
    truck = Vehicle.loads(with_rear('self_steering = "0.8 +- 0.05"', "command_steering = 0.3"))
    parameters = truck.parameters()
    assert parameters["semitrailer.rear.self_steering"] == 0.8
    assert parameters["semitrailer.front.command_steering"] == 0.3
    assert truck.stated["semitrailer.rear.self_steering"] == 0.05
    assert "semitrailer.middle.self_steering" not in parameters
    assert 'self_steering = "0.8 +- 0.05"' in truck.to_toml()
    assert Vehicle.loads(truck.to_toml()) == truck


def test_a_raised_axle_carries_no_load():
    """The moments about the kingpin: the group is then at the mean of the other two axles, 8.65 m behind it."""
    truck = Vehicle.loads(with_rear("steerable = false", "lifted = true"))
    trailer = truck.units[1]
    load = trailer.mass * STANDARD_GRAVITY * trailer.cog / -8.65
    assert truck.axle_loads()["semitrailer"] == pytest.approx(load)
    down = Vehicle.loads(with_rear("steerable = false", "steerable = false"))
    assert sum(truck.axle_loads().values()) == pytest.approx(sum(down.axle_loads().values()))
    assert truck.axle_loads()["tractor.drive"] > down.axle_loads()["tractor.drive"]
    assert [axle.name for axle in trailer.on_road] == ["middle", "rear"]
    assert topology(truck) != topology(down)
    assert Vehicle.loads(truck.to_toml()) == truck
    assert truck.to_toml().count("lifted") == 1


def test_a_class_gives_the_numbers_of_the_axles_on_the_road():
    text = """
name = "truck"
[[unit]]
name = "tractor"
class = "tractor_4x2"
mass = "7.4 t"
axle_group = [{ name = "front", position = "0 m" }, { name = "drive", position = "-3.7 m" }]
[[unit]]
name = "semitrailer"
class = "semitrailer_3"
mass = "15 t"
payload = { mass = "8 t" }
[[unit.axle_group]]
axles = [{ name = "front", position = "-6.7 m" LIFTED }, { name = "rear", position = "-9.3 m" }]
[[coupling]]
leading_position = "-3.1 m"
"""
    down, lifted = (Vehicle.loads(text.replace("LIFTED", key)) for key in ("", ", lifted = true"))
    stiffness = "semitrailer.roll_stiffness"
    assert lifted.parameters()[stiffness] == pytest.approx(down.parameters()[stiffness] / 2)
    assert lifted.tyres()["semitrailer"] == 2


@pytest.mark.parametrize(
    ("rear", "message"),
    [
        ("self_steering = 1.2", r"semitrailer\.rear\.self_steering: expected a number <= 1, got 1.2"),
        ("self_steering = -0.1", r"self_steering: expected a number >= 0, got -0.1; correct it"),
        ("self_steering = 0.8, steerable = true", "one kind of steering, got steerable and self_steering; keep"),
        ("lifted = true, steerable = true", r"rear\.lifted: expected false for a steerable axle; remove"),
        ("castor = 0.8", "castor: no such key"),
    ],
)
def test_invalid_keys_are_refused_with_a_cure(rear: str, message: str):
    with pytest.raises(VehicleError, match=message):
        Vehicle.loads(with_rear(rear))


@pytest.mark.parametrize(
    ("key", "message"),
    [
        ("lifted = true", r"tractor\.drive\.axles: expected one on the road.*leave the group out"),
        ("command_steering = 0.2", r"tractor\.drive\.command_steering: expected a unit behind a coupling"),
    ],
)
def test_an_only_axle_is_on_the_road_and_the_first_unit_has_no_articulation_to_steer_by(key: str, message: str):
    text = TEXT.replace('position = "-3.7 m"', f'position = "-3.7 m"\n{key}', 1)
    with pytest.raises(VehicleError, match=message):
        Vehicle.loads(text)


def test_a_unit_needs_an_axle_with_side_force():
    text = with_rear("self_steering = 1", "self_steering = 1")
    middle = 'position = "-8.0 m", '
    text = text.replace(f"{middle}steerable = true", f"{middle}self_steering = 1")
    with pytest.raises(VehicleError, match=r"semitrailer\.rear\.self_steering: expected an axle with side force"):
        Vehicle.loads(text)


PLACE = {"leading_position": -3.0, "trailing_position": 0.0, "height": 0.6}


def test_what_kinds_of_couplings_need() -> None:
    eye = Coupling(name="eye", kind="drawbar_eye", **PLACE)
    assert (eye.roll_stiffness, eye.roll_damping) == (0.0, 0.0)
    with pytest.raises(VehicleError, match=r"eye.roll_stiffness: expected 0 for a drawbar eye.*give another kind"):
        Coupling(name="eye", kind="drawbar_eye", roll_stiffness=1e6, **PLACE)
    with pytest.raises(VehicleError, match=r"fifth_wheel.roll_stiffness|roll_stiffness: expected a value"):
        Coupling(**PLACE)
    vehicle = get("truck_full_trailer")
    wheel = vehicle.couplings[0].model_copy(update={"kind": "fifth_wheel", "roll_stiffness": 3e6})
    with pytest.raises(VehicleError, match=r"turntable.kind: expected a drawbar_eye in front"):
        Vehicle(name="wrong", units=vehicle.units, couplings=(wheel, vehicle.couplings[1]))


def test_dolly_and_full_trailer_carry_their_weight_alone() -> None:
    """The hinged drawbar carries no vertical load: forces and moments of dolly and body balance without it, also with
    the turntable 0.3 m ahead of the axle of the dolly."""
    vehicle = get("truck_full_trailer")
    vehicle = vehicle.replace({"turntable.leading_position": vehicle.couplings[1].leading_position + 0.3})
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


BUS = catalogue.text("articulated_bus")
DAMPING = 'yaw_damping = "30 kN m s/rad"'


def with_line(line: str) -> Vehicle:
    return Vehicle.loads(BUS.replace(DAMPING, line))


def test_the_keys_have_units_and_standard_deviations() -> None:
    vehicle = with_line('yaw_stiffness = "5 kN m/rad +- 1 kN m/rad"\nyaw_damping = "20 kN m s/rad +- 50 %"')
    values = {path: value for path, value in vehicle.parameters().items() if path.startswith("joint.yaw")}
    assert values == {"joint.yaw_stiffness": 5e3, "joint.yaw_damping": 2e4}
    assert vehicle.stated == {"joint.yaw_stiffness": 1e3, "joint.yaw_damping": 1e4}
    assert Vehicle.loads(vehicle.to_toml()) == vehicle
    found = {change.name: change.slopes for change in changes(vehicle)}
    assert found["joint.yaw_damping"] == {"joint.yaw_damping": 1e4}
    assert not any(path.endswith(("yaw_stiffness", "yaw_damping")) for path in with_line("").parameters())


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("yaw_damper = 20000", r"joint\.yaw_damper: no such key; did you mean 'yaw_damping'\?"),
        ("articulation_stiffness = 1", r"no such key; did you mean .*'yaw_stiffness'"),
        ('yaw_damping = "20 kN m"', r"joint\.yaw_damping: expected N m s/rad"),
        ('yaw_stiffness = "20 kN"', r"joint\.yaw_stiffness: expected N m/rad .*; give the moment per angle"),
        ("yaw_damping = -1", r"joint\.yaw_damping: expected 0 to 1e\+06 N m s/rad"),
    ],
)
def test_a_wrong_key_or_value_is_refused_with_the_right_one(line: str, message: str) -> None:
    with pytest.raises(VehicleError, match=message):
        with_line(line)


def test_buses_and_caravans_usually_have_a_damper() -> None:
    """Not semitrailers, whose fifth wheel is ahead of the last axle, and not the drawbars of dollies."""
    for name in catalogue.names():
        found = [coupling.name for coupling in catalogue.get(name).couplings_with_damper()]
        assert found == {"articulated_bus": ["joint"], "car_caravan": ["ball"]}.get(name, []), name
