"""Steer angles from measured ones, and the reverse."""

import casadi as ca
import numpy as np
import pytest

from fifthwheel.data.channels import STEER
from fifthwheel.model import dynamics
from fifthwheel.truck import get

TRUCK = get("cheng_cebon_2011")
NAME = "steer.tractor.front"
ERRORS = {f"{NAME}.gain": 1.1, f"{NAME}.offset": 0.003, f"{NAME}.delay": 0.05, f"{NAME}.play": 0.004}
MEASURED = np.linspace(-0.2, 0.3, 7)


def test_the_angle_is_gain_times_what_is_measured_beyond_the_offset() -> None:
    found = dynamics.steer_angle(NAME, MEASURED, ERRORS)
    np.testing.assert_allclose(found.angle, 1.1 * (MEASURED - 0.003), atol=1e-16)
    np.testing.assert_allclose(found.slope, np.full(7, 1.1))


def test_an_ideal_sensor_measures_the_angle() -> None:
    angle, slope = dynamics.steer_angle(NAME, 0.1, {})
    assert (float(angle), float(slope)) == (0.1, 1.0)
    assert set(dynamics.steer_parameters(TRUCK).values()) == {0.0, 1.0}


def test_the_measured_angle_is_the_inverse() -> None:
    angles = dynamics.steer_angle(NAME, MEASURED, ERRORS).angle
    np.testing.assert_allclose(dynamics.measured_angle(NAME, angles, ERRORS), MEASURED, atol=1e-15)


def test_symbols_and_numbers_agree() -> None:
    measured = ca.SX.sym("measured")
    symbolic = ca.Function("angle", [measured], [dynamics.true_angles([NAME], measured, ERRORS)])
    for value in MEASURED:
        assert float(symbolic(value)) == dynamics.steer_angle(NAME, value, ERRORS).angle
    assert dynamics.true_angles([], ca.SX(0, 1), {}).shape == (0, 1)


def test_the_inverse_of_a_sensor_that_is_not_linear(monkeypatch: pytest.MonkeyPatch) -> None:
    def root(name: str, measured: np.ndarray, errors: object) -> dynamics.SteerAngle:
        root = np.sqrt(1 + 4 * measured)
        return dynamics.SteerAngle((root - 1) / 2, 1 / root)

    monkeypatch.setattr("fifthwheel.model.dynamics.steering.steer_angle", root)
    true = np.linspace(-0.1, 0.1, 5)
    np.testing.assert_allclose(dynamics.measured_angle(NAME, true, {}), true + true**2, atol=1e-15)


def test_the_formula_uses_every_error_but_delay_and_play() -> None:
    measured = ca.SX.sym("measured")
    errors = {error.kind: ca.SX.sym(error.kind) for error in STEER.errors}
    used = {str(symbol) for symbol in ca.symvar(STEER.true_value(measured, errors))}
    assert used == {"measured", *errors} - {"delay", "play"}
