"""Wheel speed differences of records and samples."""

import numpy as np
import pytest

from fifthwheel.data.record.derived import sample_with_differences, sides_of, wheel_speed_difference

DIFFERENCE = "wheel_speed_difference.semitrailer.middle"
LEFT, RIGHT = sides_of(DIFFERENCE)


def test_it_is_relative_to_the_mean() -> None:
    assert wheel_speed_difference(20.0, 20.2) == pytest.approx(0.2 / 20.1)
    assert np.isnan(wheel_speed_difference(0.9, 1.1))


def test_the_difference_of_a_sample() -> None:
    sample = {"time": 0.1, LEFT: 20.0, RIGHT: 20.2}
    assert sample_with_differences(sample, [DIFFERENCE]) == sample | {DIFFERENCE: pytest.approx(0.2 / 20.1)}
    assert np.isnan(sample_with_differences(sample | {RIGHT: None}, [DIFFERENCE])[DIFFERENCE])
    assert np.isnan(sample_with_differences({"time": 0.1}, [DIFFERENCE])[DIFFERENCE])
    given = {"time": 0.1, DIFFERENCE: 0.01}
    assert sample_with_differences(given, [DIFFERENCE]) is given
