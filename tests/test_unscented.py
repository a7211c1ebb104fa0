"""The unscented filters of the benchmark benchmarks/filters.py."""

import sys
from pathlib import Path

import numpy as np
import pytest

from fifthwheel.data.record import Record
from fifthwheel.estimate.observe import ObserverSettings, offline
from fifthwheel.model.simulate import simulate

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "benchmarks"))
from filters import TRUCK, Filter, observer_model

WITHOUT_LAG = TRUCK.replace({f"{path}.relaxation_length": 0.0 for path in TRUCK.axle_loads()})
SIGNALS = ("speed", "steer.tractor.front", "yaw_rate.tractor", "yaw_rate.semitrailer")
"""Of the yaw model, whose step is compiled fast."""


def lane_change(seed: int = 1) -> Record:
    """One lane change with missing and wrong measurements."""
    record = simulate(WITHOUT_LAG, count=1, seed=seed)
    signals = {name: record.signals[name].copy() for name in SIGNALS}
    signals["yaw_rate.tractor"][50:90] = np.nan
    signals["yaw_rate.semitrailer"][70:120:7] = 1.0  # outside the gate
    return Record(time=record.time, signals=signals, name="lane change")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("form", "settings"),
    [("square root", ObserverSettings()), ("covariance", ObserverSettings(bank=0.0, steer_offset=0.0))],
    ids=["square root, uncertain", "covariance, exact"],
)
def test_linear_tyres_give_the_kalman_filter(form: Filter, settings: ObserverSettings) -> None:
    """Also with a considered bank, missing and rejected measurements, and a singular covariance."""
    record = lane_change()
    expected, actual = (
        offline.states(record, observer_model(WITHOUT_LAG, SIGNALS, settings, kind), None, smooth=False)
        for kind in ("linear", form)
    )
    assert not all(accepted.all() for accepted in expected.accepted.values())
    for name, values in expected.values.items():
        np.testing.assert_allclose(actual.values[name], values, rtol=0, atol=1e-9 * np.abs(values).max())
        np.testing.assert_allclose(actual.sigma[name], expected.sigma[name], rtol=1e-6)
    np.testing.assert_allclose(actual.nis, expected.nis, rtol=1e-6)
