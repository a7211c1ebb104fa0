"""The yaw stiffness and damping of a coupling in the nonlinear truck."""

import numpy as np
import pytest

from fifthwheel.model.plant import Plant
from fifthwheel.truck import get
from tests.model.plant.test_truck import NO_RESISTANCE, response, sine

BUS, NAME = get("articulated_bus"), "yaw_rate.rear"


@pytest.mark.slow
def test_model_and_nonlinear_truck_agree() -> None:
    """And both change by a spring and a damper."""
    free = BUS.replace({"joint.yaw_damping": 0.0})
    trues, models = [], []
    for vehicle in (free, free.replace({"joint.yaw_stiffness": 1e5, "joint.yaw_damping": 5e4})):
        run = Plant(vehicle, NO_RESISTANCE).drive(sine(0.004, speed=15.0))
        truth = run.truth
        of_model = response(vehicle, run, (NAME,), tyres="saturating")[NAME]
        trues.append(truth[NAME])
        models.append(of_model)
        assert rms(of_model - truth[NAME]) < 0.08 * rms(truth[NAME])
    of_plant, of_model = (np.subtract(*pair) for pair in (trues, models))
    assert rms(of_plant) > 0.1 * rms(trues[0])
    assert rms(of_plant - of_model) < 0.2 * rms(of_plant)


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))
