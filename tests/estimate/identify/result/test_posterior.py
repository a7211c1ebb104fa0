"""The posterior of a result as an object: marginals, intervals and samples, and its tables."""

from dataclasses import replace

import numpy as np
import pytest

from fifthwheel.apps.cheng_cebon_2011 import article
from fifthwheel.base.errors import FifthwheelError
from fifthwheel.estimate.identify import Posterior
from fifthwheel.estimate.identify.one_stage.estimator import TOLERANCE
from fifthwheel.estimate.observe import Uncertainty

FRONT, AXLE, GAIN = "tractor.front.cornering_stiffness", "semitrailer.front.position", "yaw_rate.tractor.gain"


def test_estimates_and_sigmas_are_those_of_the_result(result):
    posterior = result.posterior
    frame = posterior.to_pandas()
    for e in (*result.parameters, *result.uncertain):
        assert frame.loc[e.name, ["mean", "unit"]].tolist() == [e.value, e.unit]
        assert 1 - 1e-9 < frame.loc[e.name, "sigma"] / e.sigma < np.hypot(1, TOLERANCE)  # with the next step
    for e in result.sensors:
        if f"{e.name}@{e.log}" in posterior.names:
            assert frame.loc[f"{e.name}@{e.log}", "mean"] == e.value
    assert frame.loc[AXLE, "mean"] == result.vehicle.parameters()[AXLE]
    assert frame.loc["bank.road@run", "mean"] == result.logs[0].bank[0]
    assert {name for name in result.covariance.names if not name.endswith("@")} == set(posterior.names)


def test_the_marginal_posterior(result):
    some = result.posterior.among([GAIN, FRONT])
    assert some.names == (FRONT, GAIN)
    assert some.units == ("N/rad", "1")
    i, j = (result.posterior.names.index(name) for name in some.names)
    assert some.covariance[0, 1] == result.posterior.covariance[i, j]
    assert some.correlation()[0, 1] == pytest.approx(result.posterior.correlation()[i, j])
    np.testing.assert_allclose(np.diag(result.posterior.correlation()), 1.0)


def wide(relative: float = 0.8) -> Posterior:
    """A stiffness, a position and a gain, of which the first two are correlated."""
    S = np.array([[relative * 4e5, 0, 0], [0.3, 0.4, 0], [0, 0, 0.5]])
    uncertainty = Uncertainty(names=(FRONT, AXLE, GAIN), covariance=S @ S.T)
    return Posterior(uncertainty=uncertainty, mean=np.array([4e5, -6.7, 1.0]), units=("N/rad", "m", "1"))


def test_samples_have_the_distribution_in_the_coordinates_of_the_estimator():
    posterior = wide()
    draws = posterior.sample(200_000, seed=0)
    assert np.array_equal(draws, posterior.sample(200_000, seed=0))
    assert (draws[:, 0] > 0).all()
    assert (draws[:, 2] < 0).any()  # a gain is not a parameter of the vehicle
    z = np.column_stack([np.log(draws[:, 0] / 4e5) * 4e5, draws[:, 1:] - posterior.mean[1:]])
    np.testing.assert_allclose(np.corrcoef(z.T), posterior.correlation(), atol=0.01)
    np.testing.assert_allclose(z.std(axis=0), posterior.sigma, rtol=0.01)
    inside = np.quantile(draws, [0.05, 0.95], axis=0).T
    np.testing.assert_allclose(posterior.interval(0.9), inside, rtol=0.02)
    with pytest.raises(FifthwheelError, match=r"level: expected a probability between 0 and 1, got 95; write 0\.95"):
        wide().interval(95)


def test_two_stages_have_no_joint_posterior(result):
    with pytest.raises(FifthwheelError, match=r"posterior: the two-stage method has none; identify with OneStage\(\)"):
        replace(result, covariance=None, method="two-stage", settings=article()).posterior  # noqa: B018


def test_xarray(result):
    pytest.importorskip("xarray")
    dataset = result.posterior.to_xarray()
    assert dataset["mean"].sel(parameter=FRONT) == result[FRONT].value
    assert dataset["covariance"].sel(parameter=FRONT, parameter_2=FRONT) == pytest.approx(result[FRONT].sigma ** 2)
