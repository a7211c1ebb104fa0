"""Names are taken apart and put together again."""

import pytest

from fifthwheel.base.names import NumberedName, ParameterPath, begins_with, split_kind
from fifthwheel.data.channels import SensorErrorName, split_reference


@pytest.mark.parametrize(
    ("name", "parts", "of_bend"),
    [
        ("mass_scale", ("mass_scale", None, None), "mass_scale"),
        ("steer.tractor.front.offset@3", ("steer.tractor.front.offset", 3, None), "steer.tractor.front.offset@bend"),
        ("yaw_rate.tractor@0.12", ("yaw_rate.tractor", 0, 12), "yaw_rate.tractor@bend.12"),
    ],
)
def test_numbered_name(name: str, parts: tuple[str, int | None, int | None], of_bend: str) -> None:
    parsed = NumberedName.of(name)
    assert parsed == parts
    assert parsed.of_log("bend") == of_bend
    assert parsed.log is None or parsed.of_log(parsed.log) == name


def test_parts_of_names() -> None:
    for path, owner, last_word in (
        ("semitrailer.payload.height", "semitrailer.payload", "height"),
        ("tractor.front.cornering_stiffness.variation", "tractor.front.cornering_stiffness", "variation"),
        ("mass_scale", "mass_scale", "mass_scale"),
    ):
        assert (ParameterPath.of(path).owner, ParameterPath.of(path).last_word) == (owner, last_word)
    assert split_kind("response_time.yaw_rate.tractor") == ("response_time", "yaw_rate.tractor")
    assert split_kind("understeer_gradient") == ("understeer_gradient", "")
    assert begins_with("gain.yaw_rate.tractor", "gain.yaw_rate")
    assert not begins_with("gain_sigma.yaw_rate", "gain")
    assert split_reference("reference.roll.tractor") == ("roll.tractor", True)


def test_sensor_error_of_any_text() -> None:
    assert SensorErrorName.split("yaw_rate.tractor.wobble") == ("yaw_rate.tractor", "wobble")
    assert SensorErrorName.of("yaw_rate.tractor.wobble") is None
    assert SensorErrorName.of("semitrailer.payload.height") is None
    error = SensorErrorName.of("lateral_acceleration.semitrailer.height")
    assert error is not None
    assert error.row is not None
