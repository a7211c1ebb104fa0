"""Which derivatives superposition gives."""

import pytest

from fifthwheel.estimate.design.impulse_response import along_run


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("steer.tractor.front.delay", True),
        ("steer.tractor.front.play", True),
        ("steer.tractor.front.gain", False),
        ("steer.tractor.front.offset@0", False),
        ("lateral_acceleration.tractor.delay", True),
        ("lateral_acceleration.tractor.height", False),
        ("yaw_rate.tractor.delay", False),
        ("speed.delay", False),
        ("time_base.logger.delay", False),
        ("tractor.front.softening", True),
        ("tractor.front.cornering_stiffness", False),
    ],
)
def test_what_is_not_linear_in_the_steer_angle_is_computed_along_the_run(name: str, expected: bool) -> None:
    assert along_run(name) is expected
