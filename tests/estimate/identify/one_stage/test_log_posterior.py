"""The posterior density as a function: its derivatives, its coordinates, and its profile."""

import numpy as np
import pytest

from fifthwheel.apps.cheng_cebon_2011 import article
from fifthwheel.base.errors import FifthwheelError, SignalError
from fifthwheel.estimate.identify import Identification, OneStage, identify
from fifthwheel.estimate.identify.one_stage.log_posterior import LogPosterior, log_posterior
from fifthwheel.model.simulate import simulate
from fifthwheel.truck import Vehicle

FRONT, INERTIA = "tractor.front.cornering_stiffness", "semitrailer.yaw_inertia"
OFFSET = "steer.tractor.front.offset@run"
SETTINGS = OneStage(
    given={"truck": "exact", FRONT: "free", INERTIA: "free", "relaxation_length": "+- 20 %"}, tyres="linear"
)


@pytest.fixture(scope="module")
def density(truck: Vehicle) -> LogPosterior:
    return log_posterior([simulate(truck, count=1, seed=1, name="run")], truck, SETTINGS)


@pytest.fixture(scope="module")
def result(truck: Vehicle) -> Identification:
    return identify([simulate(truck, count=1, seed=1, name="run")], truck, SETTINGS)


def free(density: LogPosterior) -> np.ndarray:
    """Which unknowns are not on a bound at the maximum."""
    lower, upper = density.bounds
    return (density.mean > lower) & (density.mean < upper)


def test_the_gradient_is_that_of_differences(density: LogPosterior) -> None:
    sigma = np.sqrt(np.diag(density.covariance))
    x = np.clip(density.mean + 0.5 * sigma, *density.bounds)
    gradient, step = density.gradient(x), 1e-3
    for i in [i for i, name in enumerate(density.names) if not name.endswith((".delay", ".play"))]:
        shift = step * sigma[i] * np.eye(len(x))[i]
        expected = (density(x + shift) - density(x - shift)) / (2 * step * sigma[i])
        assert gradient[i] == pytest.approx(expected, abs=1e-3 / sigma[i]), density.names[i]


def test_the_gradient_vanishes_at_the_maximum(density: LogPosterior) -> None:
    """In standard deviations the distance of the maximum is that of the search's tolerance."""
    inside = free(density)
    step = density.covariance[np.ix_(inside, inside)] @ density.gradient(density.mean)[inside]
    assert (np.abs(step) < 0.07 * np.sqrt(np.diag(density.covariance))[inside]).all()
    assert density(density.mean) > density(
        np.clip(density.mean + 0.1 * np.sqrt(np.diag(density.covariance)), *density.bounds)
    )


def test_the_information_is_that_of_the_logs(density: LogPosterior) -> None:
    information = density.fisher_information(density.mean)
    np.testing.assert_allclose(
        np.linalg.inv(information + np.eye(len(information))), density.covariance, rtol=0.02, atol=1e-4
    )
    i = density.names.index("roll_rate.tractor.gain")
    assert information[i, i] < 0.1  # one lane change does not determine it


def test_the_maximum_is_the_result(density: LogPosterior, result: Identification) -> None:
    values = density.values(density.mean)
    estimated = [e for e in result.parameters if e.name in (FRONT, INERTIA)]
    for e in (*estimated, *result.uncertain):
        assert values[e.name] == pytest.approx(e.value, rel=1e-9)
    assert values[OFFSET] == next(e.value for e in result.sensors if OFFSET.startswith(e.name) and e.log == "run")
    assert density.log_likelihood(density.mean) == pytest.approx(result.log_likelihood)
    front = result[FRONT]
    relative = np.sqrt(np.diag(density.covariance))[density.names.index(FRONT)] * front.prior / front.initial
    assert relative * front.value == pytest.approx(front.sigma, rel=0.2)  # which allows for model error, too


def test_values_by_name_are_a_point(density: LogPosterior) -> None:
    x = density.mean.copy()
    x[[density.names.index(FRONT), density.names.index(OFFSET)]] += 0.3
    values = density.values(x)
    changed = {name: float(values[name]) for name in (FRONT, OFFSET)}
    assert density(changed) == pytest.approx(density(x), rel=1e-12)
    assert density(changed) < density({})
    draws = np.array([density.mean, x, x])
    assert density.values(draws)[FRONT].shape == (3,)
    assert density.values(draws)[FRONT][1] == values[FRONT]
    assert "bank.road@run.0" in density.names
    assert "bank.road@run.0" not in values


def test_wrong_arguments_are_refused(density: LogPosterior, truck: Vehicle) -> None:
    record = simulate(truck, count=1)
    with pytest.raises(SignalError, match=r"x: expected \d+ numbers, as in names, got shape \(3,\)"):
        density(np.zeros(3))
    with pytest.raises(SignalError, match=r"semitrailer.yaw_inerta: not an estimated unknown; did you mean"):
        density({"semitrailer.yaw_inerta": 4e5})
    with pytest.raises(SignalError, match=r"bank.road@run.0: not an estimated unknown"):
        density.profile("bank.road@run.0")
    with pytest.raises(SignalError, match=r"settings: expected a OneStage, got TwoStage"):
        log_posterior([record], truck, article())  # type: ignore[arg-type]
    with pytest.raises(SignalError, match=r"records: expected a list .*write \[record\]"):
        log_posterior(record, truck)  # type: ignore[arg-type]


def test_the_profile_is_near_the_normal_density_and_above_every_section(density: LogPosterior) -> None:
    profile = density.profile(INERTIA, sigmas=2.0, points=5)
    np.testing.assert_allclose(profile.log_density, profile.normal, atol=0.1)
    assert profile.log_density.max() <= 0
    sections = [density({INERTIA: value}) - density(density.mean) for value in profile.values]
    assert (profile.log_density > np.array(sections) - 0.01).all()
    assert profile.log_density[0] > sections[0] + 0.1  # the others follow
    assert profile.unit == "kg m^2"


def test_the_interval_of_the_profile_is_that_of_the_posterior(density: LogPosterior, result: Identification) -> None:
    """Residuals of a log of the model itself are white, so that the posterior is not widened much."""
    profile = density.profile(INERTIA, sigmas=2.5, points=7)
    (normal,) = result.posterior.among([INERTIA]).interval(0.9)
    width = normal[1] - normal[0]
    np.testing.assert_allclose(profile.interval(0.9), normal, atol=0.1 * width)
    assert np.isinf(profile.interval(0.999)).all()  # beyond the points
    with pytest.raises(FifthwheelError, match="level: expected a probability"):
        profile.interval(1.0)
    (panel,) = profile.plot().panels
    normal, line, maximum = panel.items
    np.testing.assert_allclose(line.y, np.exp(profile.log_density))
    np.testing.assert_allclose(normal.x, profile.values)
    assert maximum.x == pytest.approx(profile.best)


def test_where_there_is_no_density(density: LogPosterior) -> None:
    """Beyond a bound it is zero; where an unknown is not finite there is no derivative."""
    x = density.mean.copy()
    x[0] = density.bounds[1][0] + 0.1
    assert density(x) == density({FRONT: -1.0}) == -np.inf
    x[0] = np.nan
    assert density(x) == -np.inf
    for derivative in (density.gradient, density.fisher_information):
        with pytest.raises(SignalError, match=r"x, tractor.front.*: expected a finite number, got nan; the density"):
            derivative(x)
