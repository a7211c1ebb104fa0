"""Settings that are refused, and the published ones."""

import pytest

from fifthwheel.errors import SignalError
from fifthwheel.identify import CommonSettings, OneStage, TwoStage, article


@pytest.mark.parametrize(
    ("kind", "changes", "message"),
    [
        (TwoStage, {"passes": 0}, "passes: expected a number above 0, got 0"),
        (TwoStage, {"prior": 0.0}, "prior: expected a number above 0"),
        (TwoStage, {"forgetting": 0.0}, "forgetting: expected a number above 0 and at most 1, got 0"),
        (TwoStage, {"noise": {"yaw_rate.tractor": 0.0}}, "yaw_rate.tractor: expected a finite variance above 0, got 0"),
        (OneStage, {"tolerance": float("nan")}, "tolerance: expected a number above 0, got nan"),
        (OneStage, {"iterations": 0}, "iterations: expected a number above 0, got 0"),
        (OneStage, {"priors": {"mass": -0.1}}, "mass: expected a standard deviation above 0"),
        (OneStage, {"consider": {"mass": float("inf")}}, "mass: expected a standard deviation above 0"),
    ],
)
def test_refused(kind: type[CommonSettings], changes: dict[str, object], message: str) -> None:
    with pytest.raises(SignalError, match=message):
        kind(**changes)


def test_article() -> None:
    """Section 3: Q_p of 0.1 %, 5 mm for the height, lambda 0.999; changes replace single settings."""
    settings = article(forgetting=0.9995)
    assert (settings.preset, settings.random_walk, settings.height_walk) == ("article", 0.001, 0.005)
    assert settings.forgetting == 0.9995
    assert article().forgetting == 0.999
