"""Both sides of every limit of a doubt of one stage, with the numbers of the documentation."""

import math
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.optimize import brentq

from fifthwheel.data.record import Record
from fifthwheel.estimate.identify.dataset import Dataset
from fifthwheel.estimate.identify.doubts import Doubt, DoubtKind, PriorTest, linear_odds
from fifthwheel.estimate.identify.one_stage.doubts import quick_doubts
from fifthwheel.estimate.identify.one_stage.posterior import ScaledPosterior
from fifthwheel.estimate.identify.one_stage.solution import Solution
from fifthwheel.estimate.identify.unknowns.unknown import Unknown, gross_error

BELOW, ABOVE = 1 - 1e-9, 1 + 1e-9
BOUNDS = {"lower": -9.0, "upper": 9.0}
STIFFNESS = Unknown(name="stiffness", centre=2.0, scale=0.3, logarithmic=True, reported=True, **BOUNDS)
HEIGHT = Unknown(name="height", centre=1.0, scale=0.6, reported=True, **BOUNDS)
OFFSET = Unknown(name="yaw_rate.tractor.offset", centre=0.0, scale=0.004, per_log=True, **BOUNDS)
MASS = Unknown(name="mass", centre=1e4, scale=0.1, logarithmic=True, **BOUNDS)
DELAY = Unknown(name="yaw_rate.tractor.delay", centre=0.0, scale=0.01, **BOUNDS)
COG = Unknown(name="cog", centre=0.0, scale=0.2, moves={"x": 2.0, "y": -1.0}, **BOUNDS)
UNKNOWNS = (STIFFNESS, HEIGHT, OFFSET, MASS, DELAY, COG)
NAMES = ("stiffness", "height", "offset@0", "mass", "delay", "cog", "offset@1")
SIGMA = np.array([0.2, 0.5, 0.4, 1.0, 1.0, 1.0, 0.8])


def doubts(z=(), tests=(), correlation=None, records=(), yaw_rate_offset=0.0, min_speed=5.0) -> list[Doubt]:
    """The doubts of two logs with two parameters, an offset of each log, and three uncertain numbers."""
    covariance = np.diag(SIGMA**2) if correlation is None else correlation * np.outer(SIGMA, SIGMA)
    posterior = ScaledPosterior(names=NAMES, information=np.zeros((7, 7)), covariance=covariance)
    problem = SimpleNamespace(
        names=NAMES,
        unknowns=UNKNOWNS,
        unknowns_by_name=dict(zip(NAMES, (*UNKNOWNS, OFFSET), strict=True)),
        values=lambda _, log: {"yaw_rate.tractor.offset": yaw_rate_offset} if log == 0 else {},
    )
    dataset = SimpleNamespace(vehicle=SimpleNamespace(units=[SimpleNamespace(name="tractor")]), records=records)
    dataset.lateral_accelerations = partial(Dataset.lateral_accelerations, dataset)
    solution = SimpleNamespace(
        problem=problem,
        minimum=SimpleNamespace(z=np.array([dict(z).get(name, 0.0) for name in NAMES])),
        estimated=("stiffness", "height"),
        dataset=dataset,
        settings=SimpleNamespace(min_speed=min_speed, tyre_law="linear"),
        linearisation=SimpleNamespace(tests=tests, posterior=posterior),
    )
    solution.lateral_accelerations = Solution.lateral_accelerations.func(solution)
    return quick_doubts(solution)


def score(name: str, statistic: float, implied: float, **shifts: float) -> PriorTest:
    return PriorTest(
        name=name,
        statistic=statistic,
        implied=implied,
        shifts=np.array([shifts.get(n, 0.0) for n in NAMES]),
    )


def limit(unknown: Unknown, implied: float, odds: float = 0.0) -> float:
    """The statistic, with a change that the logs imply, at which a gross error has these odds, logarithm."""
    error = gross_error(unknown)

    def excess(t: float) -> float:
        return linear_odds(PriorTest(name="", statistic=t, implied=implied, shifts=np.zeros(0)), error) - odds

    return float(brentq(excess, 0.5, abs(implied), xtol=1e-14))


@pytest.mark.parametrize("sign", [-1, 1])
def test_a_contradicted_assumption(sign: int) -> None:
    """A gross error is as probable as none; `cog` alters x and y."""
    t = limit(COG, 5.0)
    assert 3 < t < 4
    assert doubts(tests=(score("cog", sign * t * BELOW, sign * 5.0),)) == []
    (doubt,) = doubts(tests=(score("cog", sign * t * ABOVE, sign * 5.0),))
    assert (doubt.kind, doubt.parameters, doubt.log, doubt.statistic) == (DoubtKind.ASSUMPTION, (), None, t * ABOVE)
    (cause,) = doubt.causes
    assert (cause.name, cause.prior_sigmas) == ("cog", sign * 5.0)
    assert cause.changes == pytest.approx({"x": sign * 2 * 0.2 * 5.0, "y": -sign * 0.2 * 5.0})


@pytest.mark.parametrize("sign", [-1, 1])
def test_estimates_that_a_contradicted_assumption_moves(sign: int) -> None:
    """By more than half a sigma; all of them if |t| is above 9. An offset is no estimate of a parameter."""
    for edge, moved in ((1.0, ()), (ABOVE, ("stiffness",))):
        shifts = {"stiffness": sign * 0.5 * 0.2 * edge, "height": 0.49 * 0.5, "offset@0": 99.0, "mass": 99.0}
        for statistic, parameters in ((9.0, moved), (-9.0, moved), (9 * ABOVE, None), (-9 * ABOVE, None)):
            found = doubts(tests=(score("mass", statistic, 9.5 * np.sign(statistic), **shifts),))
            (doubt,) = [d for d in found if d.kind is DoubtKind.ASSUMPTION]
            assert doubt.parameters == (("stiffness", "height") if parameters is None else parameters)


def test_causes_that_are_about_as_likely() -> None:
    """Within a factor of 20; together they move the estimates that each of them moves, named once."""
    first = score("mass", -8.0, -8.5, height=1.0)
    near = limit(DELAY, 9.0, linear_odds(first, gross_error(MASS)) - math.log(20))
    (doubt,) = doubts(tests=(first, score("delay", near * ABOVE, 9.0, height=1.0, stiffness=-1.0)))
    assert [cause.name for cause in doubt.causes] == ["mass", "delay"]
    assert doubt.parameters == ("height", "stiffness")
    assert doubt.statistic == 8.0
    (doubt,) = doubts(tests=(first, score("delay", near * BELOW, 9.0, stiffness=-1.0)))
    assert [cause.name for cause in doubt.causes] == ["mass"]
    assert doubt.parameters == ("height",)


@pytest.mark.parametrize("sign", [-1, 1])
@pytest.mark.parametrize("name", ["offset@0", "offset@1"])
def test_a_sensor_error_far_from_its_prior(name: str, sign: int) -> None:
    """More than 3.5 prior sigmas, in its log; of the delay, which is uncertain, the test of the prior counts."""
    assert doubts({name: sign * 3.5, "delay": sign * 99.0}) == []
    (doubt,) = doubts({name: sign * 3.5 * ABOVE, "delay": sign * 99.0})
    assert (doubt.kind, doubt.parameters) == (DoubtKind.SENSOR, ())
    assert doubt.statistic == pytest.approx(3.5)
    (cause,) = doubt.causes
    assert (cause.name, cause.prior_sigmas) == (name, sign * 3.5 * ABOVE)
    assert cause.changes == {"yaw_rate.tractor.offset": pytest.approx(sign * 3.5 * 0.004)}


@pytest.mark.parametrize("sign", [-1, 1])
def test_estimates_that_a_sensor_error_moves(sign: int) -> None:
    """With the offset known to be 0, the estimate changes by rho sigma z / sigma_z: here by half a sigma at rho = 0.1.

    z = 4 and sigma_z = 0.8 of the second log.
    """
    for edge, moved in ((BELOW, ()), (ABOVE, ("height",))):
        correlation = np.eye(7)
        correlation[1, 6] = correlation[6, 1] = sign * 0.1 * edge
        (doubt,) = doubts({"offset@1": 4.0}, correlation=correlation)
        assert doubt.parameters == moved


@pytest.mark.parametrize("sign", [-1, 1])
def test_an_estimate_far_from_its_prior(sign: int) -> None:
    """More than 2.5 prior sigmas, of a stiffness or an inertia; the prior of a height is wide, a mass is uncertain."""
    far = {"height": sign * 9.0, "mass": sign * 9.0}
    assert doubts({"stiffness": sign * 2.5, **far}) == []
    (doubt,) = doubts({"stiffness": sign * 2.5 * ABOVE, **far})
    assert (doubt.kind, doubt.parameters) == (DoubtKind.ESTIMATE, ("stiffness",))
    assert doubt.statistic == pytest.approx(2.5)
    assert doubt.causes[0].changes == {"stiffness": pytest.approx(2 * np.expm1(sign * 2.5 * 0.3))}


def turning(acceleration: float, speed: float = 20.0, name: str = "turn") -> Record:
    signals = {"speed": np.full(200, speed), "yaw_rate.tractor": np.full(200, acceleration / speed)}
    return Record(time=np.arange(200) / 100, signals=signals, name=name)


def test_a_log_beyond_the_linear_range() -> None:
    """Above 3 m/s^2 with the offset of the gyro in that log, at speeds from `min_speed` on."""
    assert doubts(records=[turning(3 * BELOW), turning(-3 * BELOW)]) == []
    (doubt,) = doubts(records=[turning(1.0), turning(-3 * ABOVE, name="left")])
    assert (doubt.kind, doubt.causes, doubt.log) == (DoubtKind.RANGE, (), "left")
    assert doubt.parameters == ("stiffness", "height")
    assert doubt.statistic == pytest.approx(3)
    both = [turning(3.1, name="first"), turning(3.1, name="second")]
    assert [doubt.log for doubt in doubts(records=both, yaw_rate_offset=0.01)] == ["second"]
    assert [doubt.log for doubt in doubts(records=both, yaw_rate_offset=0.4)] == ["first", "second"]
    assert len(doubts(records=[turning(4.0, speed=7.0)], min_speed=7.0)) == 1
    assert doubts(records=[turning(4.0, speed=7.0)], min_speed=7.1) == []
