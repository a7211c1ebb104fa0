"""The linearisation of several logs: sums over all of them, one after the other in the history."""

import pytest

from fifthwheel.data.record.derived import article_gyro_variance
from fifthwheel.estimate.identify import OneStage, identify
from fifthwheel.estimate.identify.one_stage import solution
from fifthwheel.model.simulate import simulate
from fifthwheel.truck import Vehicle

UNITS = ("tractor", "semitrailer")


def test_sigma_of_residuals_that_scatter_more_than_their_variance(
    truck: Vehicle, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With a 25th of the true noise variance, the scores of every log widen sigma by 5, of two logs as of one."""
    monkeypatch.setattr(solution, "CORRELATION_TIME", 0.02)
    right = dict(article_gyro_variance(UNITS))
    wrong = {name: variance / 25 for name, variance in right.items()}
    logs = [simulate(truck, count=1, seed=seed, name=f"log {seed}") for seed in (1, 2)]
    common = {
        "given": {"others": "exact", "sensors": "exact"},
        "adapt_noise": False,
        "outlier": 100.0,
        "tyres": "linear",
    }
    expected = identify(logs, truck, OneStage(noise=right, **common))
    actual = identify(logs, truck, OneStage(noise=wrong, **common))
    for e in expected.parameters:  # within the sampling error of the variance of the scores
        assert actual[e.name].sigma == pytest.approx(e.sigma, rel=0.2), e.name
        assert actual[e.name].value == pytest.approx(e.value, abs=0.3 * e.sigma), e.name
