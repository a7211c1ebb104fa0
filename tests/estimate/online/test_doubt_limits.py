"""Both sides of every limit of a doubt of a learner, with the numbers of the documentation."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.optimize import brentq

from fifthwheel.base.types import Array
from fifthwheel.estimate.filters.relinearised import JointEstimate
from fifthwheel.estimate.identify.doubts import Doubt, DoubtKind, PriorTest, linear_odds
from fifthwheel.estimate.identify.unknowns.unknown import Unknown, gross_error
from fifthwheel.estimate.online import LearnerSettings
from fifthwheel.estimate.online.learned import find_doubts, score_tests
from fifthwheel.estimate.online.start import Considered

BELOW, ABOVE = 1 - 1e-9, 1 + 1e-9
BOUNDS = {"lower": -9.0, "upper": 9.0}
ESTIMATED = (
    Unknown(name="stiffness", centre=2.0, scale=0.3, logarithmic=True, reported=True, **BOUNDS),
    Unknown(name="yaw_rate.tractor.offset", centre=0.0, scale=0.004, **BOUNDS),
    Unknown(name="height", centre=1.0, scale=0.6, reported=True, **BOUNDS),
)
CONSIDERED = (
    Unknown(name="mass", centre=1e4, scale=0.1, logarithmic=True, estimated=False, **BOUNDS),
    Unknown(name="cog", centre=0.0, scale=0.2, estimated=False, moves={"x": 2.0, "y": -1.0}, **BOUNDS),
)
PROBLEM = SimpleNamespace(
    unknowns=(*ESTIMATED, *CONSIDERED), estimated_unknowns=ESTIMATED, considered_unknowns=CONSIDERED
)
PZ, B = np.diag([0.03, 0.15, 0.2]), np.array([[0.1, 0.0], [0.0, 0.1], [0.0, 0.2]])
SIGMA = np.sqrt([0.04, 0.16, 0.24])  # of Pz + B B'


def doubts(z=(0.0, 0.0, 0.0), t=(0.0, 0.0), information=(1.0, 1.0), size=1.0, autocorrelation=1.0, **of) -> list[Doubt]:
    """The doubts with these statistics of the score tests."""
    gradient = -np.array(t) * np.sqrt(information)
    estimate = estimated(
        z=np.array(z), Pz=of.get("Pz", PZ), B=of.get("B", B), gradient=gradient, information=np.array(information)
    )
    innovations = SimpleNamespace(mean_square=[0.9, size], autocorrelation=[autocorrelation, 0.9])
    return list(find_doubts(live_filter(innovations), estimate))


def live_filter(innovations: SimpleNamespace | None = None) -> SimpleNamespace:
    """A filter of which the considered unknowns have their priors."""
    known = Considered.of(np.zeros(2), np.eye(2))
    return SimpleNamespace(setup=PROBLEM, learner=LearnerSettings(), innovations=innovations, considered=known)


def estimated(z: Array, **of: Array) -> JointEstimate:
    return JointEstimate(z=z, correlation=np.eye(2), **of)


def test_score_tests() -> None:
    """Of a scalar c with y = c + noise of variance 1 / I: the estimate without and with its prior N(0, 1)."""
    estimate = estimated(z=np.zeros(3), Pz=PZ, B=B, gradient=np.array([-20.0, 45.0]), information=np.array([4.0, 9.0]))
    first, second = score_tests(live_filter(), estimate)
    assert (first.name, second.name) == ("mass", "cog")
    assert (first.statistic, second.statistic) == pytest.approx((5 / np.sqrt(1 + 1 / 4), -5 / np.sqrt(1 + 1 / 9)))
    assert (first.implied, second.implied) == (5.0, -5.0)
    np.testing.assert_allclose(second.shifts, [0.0, -0.5, -1.0])


def test_a_number_of_the_vehicle_is_tested_from_a_change_on() -> None:
    """Of 3.5 prior sigmas, |g| / (1 + I); a sensor error from any."""
    delay = Unknown(name="yaw_rate.tractor.delay", centre=0.0, scale=0.01, estimated=False, **BOUNDS)
    live = live_filter()
    live.setup = SimpleNamespace(considered_unknowns=(CONSIDERED[0], delay))
    for change, information, tested in (
        (3.5 * ABOVE, 1.0, ["mass", delay.name]),
        (3.5 * BELOW, 1.0, [delay.name]),
        (3.5 * ABOVE, 0.0, []),
    ):
        gradient = np.full(2, -change * (1 + information))
        found = estimated(z=np.zeros(3), Pz=PZ, B=B, gradient=gradient, information=np.full(2, information))
        assert [test.name for test in score_tests(live, found)] == tested


def limit(unknown: Unknown, information: float, odds: float = 0.0) -> float:
    """The score over its standard deviation at which a gross error has these odds, logarithm."""
    error = gross_error(unknown)

    def excess(t: float) -> float:
        statistic, implied = t / np.sqrt(1 + information), t / np.sqrt(information)
        return linear_odds(PriorTest(name="", statistic=statistic, implied=implied, shifts=np.zeros(0)), error) - odds

    return float(brentq(excess, 0.1, 99.0, xtol=1e-14))


@pytest.mark.parametrize("sign", [-1, 1])
@pytest.mark.parametrize("information", [4.0, 100.0])
def test_a_contradicted_assumption(sign: int, information: float) -> None:
    """A gross error is as probable as none; `cog` alters x and y."""
    t = limit(CONSIDERED[1], information)
    assert doubts(t=(0.0, sign * t * BELOW), information=(1.0, information)) == []
    (doubt,) = doubts(t=(0.0, sign * t * ABOVE), information=(1.0, information))
    assert doubt.kind is DoubtKind.ASSUMPTION
    assert doubt.statistic == pytest.approx(t / np.sqrt(1 + information))
    implied = sign * t / np.sqrt(information)
    (cause,) = doubt.causes
    assert (cause.name, cause.prior_sigmas) == ("cog", pytest.approx(implied))
    assert cause.changes == pytest.approx({"x": 2 * 0.2 * implied, "y": -0.2 * implied})


def test_causes_that_are_about_as_likely() -> None:
    """Within a factor of 20; an estimate that both move is named once."""
    B = np.array([[0.0, 1.0], [0.0, 0.0], [1.0, 1.0]])
    first, second = limit(CONSIDERED[0], 4.0, odds=5.0), limit(CONSIDERED[1], 4.0, odds=5.0 - np.log(20))
    for edge, names in ((ABOVE, ["mass", "cog"]), (BELOW, ["mass"])):
        (doubt,) = doubts(t=(first, -second * edge), information=(4.0, 4.0), B=B)
        assert [cause.name for cause in doubt.causes] == names
        assert doubt.parameters == (("height", "stiffness") if len(names) == 2 else ("height",))


@pytest.mark.parametrize("sign", [-1, 1])
def test_estimates_far_from_their_priors(sign: int) -> None:
    """A sensor error by more than 3.5, a stiffness by more than 2.5 prior sigmas; the prior of a height is wide."""
    assert doubts((sign * 2.5, sign * 3.5, sign * 9.0)) == []
    (estimate,) = doubts((sign * 2.5 * ABOVE, sign * 3.5, sign * 9.0))
    assert (estimate.kind, estimate.parameters) == (DoubtKind.ESTIMATE, ("stiffness",))
    assert estimate.statistic == pytest.approx(2.5)
    assert estimate.causes[0].changes == {"stiffness": pytest.approx(2 * np.expm1(sign * 2.5 * 0.3))}
    (sensor,) = doubts((sign * 2.5, sign * 3.5 * ABOVE, sign * 9.0), B=np.zeros((3, 2)))
    assert (sensor.kind, sensor.parameters) == (DoubtKind.SENSOR, ())
    assert sensor.statistic == pytest.approx(3.5)
    assert sensor.causes[0].changes == {"yaw_rate.tractor.offset": pytest.approx(sign * 3.5 * 0.004)}


def test_innovations_that_noise_does_not_explain() -> None:
    """A mean square above 2, or an autocorrelation above 5."""
    assert doubts(size=2.0, autocorrelation=5.0) == []
    for changes, statistic in (({"size": 2 * ABOVE}, 2), ({"autocorrelation": 5 * ABOVE}, 5)):
        (doubt,) = doubts(**changes)
        assert (doubt.kind, doubt.causes, doubt.parameters) == (DoubtKind.NOISE, (), ("stiffness", "height"))
        assert doubt.statistic == pytest.approx(statistic)
