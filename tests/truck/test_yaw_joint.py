"""The yaw stiffness and damping of a coupling in the vehicle file, and which couplings usually have a damper."""

import pytest

from fifthwheel.base.errors import VehicleError
from fifthwheel.truck import Vehicle, catalogue, changes

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
