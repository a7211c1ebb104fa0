"""The information of single logs, against the identification of all logs together."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

import fifthwheel as fw
from fifthwheel.estimate.identify.doubts import Cause, Doubt, DoubtKind, describe_doubt
from fifthwheel.estimate.identify.given import applied
from fifthwheel.estimate.identify.knowledge.information import Labels
from fifthwheel.estimate.identify.one_stage.estimator import solve_one_stage
from fifthwheel.estimate.identify.one_stage.problem import Problem
from fifthwheel.estimate.identify.one_stage.shared_information import (
    marginal_information,
    shared_information,
    with_doubts,
)
from fifthwheel.estimate.identify.one_stage.solution import LogLinearisation, Solution
from fifthwheel.estimate.identify.setup import Setup

TRUCK = fw.vehicle("cheng_cebon_2011")
GUESS = TRUCK.replace({"tractor.front.cornering_stiffness": 4.2e5, "semitrailer.cornering_stiffness": 1.1e6})


LABELS = Labels.of(TRUCK, fw.Occasion())


def record(seed, *, count=1, without=""):
    made = fw.simulate(TRUCK, count=count, seed=seed, speed=20.0 + seed)
    signals = {name: values for name, values in made.signals.items() if not (without and name.startswith(without))}
    return fw.Record(time=made.time, signals=signals, name=f"run {seed}")


def linearised_alone(together, i):
    """Log i, linearised at the solution of all logs."""
    problem = together.problem
    alone = Problem(problem.setup, [problem.logs[i]])
    alone.logs = (problem.logs[i],)  # with the noise model
    own = [name.replace("@0", f"@{i}") for name in alone.names]
    z = together.minimum.z[[problem.names.index(name) for name in own]]
    return Solution(dataset=together.dataset, minimum=replace(together.minimum, objective=alone, z=z), uninformed={})


@pytest.mark.slow
def test_information_of_single_logs_adds_to_the_normal_equations_of_all() -> None:
    """All logs linearised at one point: with the prior N(0, I), the sums give estimate and covariance of all shared
    unknowns, of the masses and lengths of the vehicle file too. Linear tyres have no friction, which is the log's own;
    without gains there is no logarithm, and without play no bound."""
    exact = dict.fromkeys(("steer.*.gain", "*_rate.*.gain", "play"), "exact")
    normal = dict.fromkeys(("cornering_stiffness", "yaw_inertia"), "+- 30 %")
    settings = fw.OneStage(tyres="linear", given=exact | normal)
    together = solve_one_stage([record(0), record(1)], *applied(GUESS, settings))
    first, second = (shared_information(linearised_alone(together, i), LABELS) for i in range(2))
    assert first.names == second.names
    assert {"mass_scale", "semitrailer.payload.mass", "time_base"} <= set(first.names)
    P = np.linalg.inv(np.eye(len(first.names)) + first.information + second.information)
    linearisation, z = together.linearisation, together.minimum.z
    expected = linearisation.posterior.model_covariance
    places = [linearisation.posterior.names.index(name) for name in first.names]
    np.testing.assert_allclose(P, expected[np.ix_(places, places)], atol=1e-8)
    step = z - expected @ (linearisation.gradient + z)  # the search ends when this step is small
    np.testing.assert_allclose(P @ (first.vector + second.vector), step[places], atol=1e-7)


def test_a_parameter_that_needs_a_missing_roll_rate_is_not_shared() -> None:
    (log,) = fw.identify([record(2, without="roll_rate")], GUESS, fw.OneStage(tyres="linear")).knowledge.logs
    information = log.information
    assert "semitrailer.payload.height" not in information.names
    assert "semitrailer.cornering_stiffness" in information.names


def test_a_gain_is_shared_by_its_logarithm() -> None:
    """Also with a prior mean that is not 1; the vector is that of the estimates where the logs have no gradient."""
    steer = "steer.tractor.front.gain"
    settings = fw.OneStage(tyres="linear", given={steer: "1.1 +- 0.05"})
    outputs = ("yaw_rate.tractor", "yaw_rate.semitrailer")
    setup = Setup.of(TRUCK.with_logged_steering(["steer.tractor.front"], "log"), outputs, settings)
    names = [u.name for u in setup.unknowns]
    z = np.linspace(-1.0, 1.0, len(names))
    log = LogLinearisation(
        indices=np.arange(len(names)),
        information=np.diag(np.linspace(1.0, 9.0, len(names))),
        gradient=np.zeros(len(names)),
        score_covariance=np.eye(len(names)),
    )
    found = marginal_information(setup, names, z, log, LABELS)
    estimate = np.linalg.solve(found.information, found.vector)
    gains = [name for name in found.names if name.endswith(".gain")]
    assert steer in gains
    for name in gains:
        i, (u,) = found.names.index(name), [u for u in setup.unknowns if u.name == name]
        assert found.logarithmic[i]
        gain = found.centre[i] * np.exp(found.scale[i] * estimate[i])
        assert gain == pytest.approx(u.centre + u.scale * z[names.index(name)])
        assert found.centre[i] * found.scale[i] == pytest.approx(u.scale)  # one prior sigma, SI
        k = names.index(name)  # of a diagonal matrix: dz/du squared
        assert found.information[i, i] == pytest.approx(log.information[k, k] * (gain / u.centre) ** 2)
    (centre,) = [u.centre for u in setup.unknowns if u.name == steer]
    assert centre == 1.1
    for name in set(found.names) - set(gains):
        assert estimate[found.names.index(name)] == pytest.approx(z[names.index(name)]), name


@dataclass(frozen=True)
class Log:
    """What doubts need of a log."""

    name: str
    doubts: tuple[str, ...] = ()


def test_a_doubt_belongs_to_the_logs_of_its_causes() -> None:
    """By the numbers of its causes or by its log; a doubt of what logs share belongs to all."""

    def doubt(*names, kind=DoubtKind.ASSUMPTION, log=None):
        causes = tuple(Cause(name=name, changes={}, prior_sigmas=4.0) for name in names)
        return Doubt(kind=kind, causes=causes, parameters=(), statistic=4.0, log=log)

    doubts = [
        doubt(kind=DoubtKind.RANGE, log="second"),
        doubt("gyro.offset@0"),
        doubt("mass"),
        doubt("gyro.offset@0", "gyro.gain@1"),
        doubt("gyro.offset@0", "cog"),
    ]
    first, second = with_doubts([Log("first"), Log("second")], doubts)
    assert first.doubts == tuple(describe_doubt(doubts[k]) for k in (1, 2, 3, 4))
    assert second.doubts == tuple(describe_doubt(doubts[k]) for k in (0, 2, 3, 4))
