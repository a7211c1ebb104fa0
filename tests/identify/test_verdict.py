"""The rules that decide a verdict."""

import math

import numpy as np
import pytest

from fifthwheel.identify.one_stage.posterior import ScaledPosterior
from fifthwheel.identify.unknowns.parameters import lacks_roll_rate
from fifthwheel.identify.unknowns.unknown import Unknown, UnknownKind
from fifthwheel.identify.verdict import (
    Verdict,
    estimate_verdict,
    information_verdicts,
    uncertain_verdict,
    uninformed_parameters,
)

STIFFNESS, HEIGHT = "tractor.front.cornering_stiffness", "semitrailer.payload.height"
YAW_RATES = ("yaw_rate.tractor", "yaw_rate.semitrailer")
LIMIT = 0.7


def test_by_information() -> None:
    """A parameter without information is not excited if there is none on any other, else not identifiable."""
    empty = ScaledPosterior.from_information(("a", "b"), np.zeros((2, 2)))
    assert set(information_verdicts(empty, [0, 1], LIMIT).values()) == {Verdict.NOT_EXCITED}
    partial = ScaledPosterior.from_information(("a", "b"), np.diag([100.0, 0.0]))
    assert information_verdicts(partial, [0, 1], LIMIT) == {0: Verdict.CONVERGED, 1: Verdict.NOT_IDENTIFIABLE}


@pytest.mark.parametrize(
    ("information", "channels", "expected"),
    [
        ([100.0, 100.0], (*YAW_RATES, "roll_rate.semitrailer"), {}),
        ([100.0, 100.0], YAW_RATES, {HEIGHT: Verdict.NOT_IDENTIFIABLE}),
        ([100.0, 100.0], (*YAW_RATES, "roll_rate.tractor"), {HEIGHT: Verdict.NOT_IDENTIFIABLE}),
        ([0.0, 0.0], YAW_RATES, {STIFFNESS: Verdict.NOT_EXCITED, HEIGHT: Verdict.NOT_EXCITED}),
        ([0.0, 100.0], YAW_RATES, {STIFFNESS: Verdict.NOT_IDENTIFIABLE, HEIGHT: Verdict.NOT_IDENTIFIABLE}),
    ],
)
def test_uninformed(information: list[float], channels: tuple[str, ...], expected: dict[str, Verdict]) -> None:
    """A payload height needs the roll rate of its own unit, whatever the information says."""
    posterior = ScaledPosterior.from_information((STIFFNESS, HEIGHT), np.diag(information))
    without = [name for name in (STIFFNESS, HEIGHT) if lacks_roll_rate(name, channels)]
    assert uninformed_parameters(posterior, (STIFFNESS, HEIGHT), without, LIMIT) == expected


@pytest.mark.parametrize(
    ("value", "converged", "expected"),
    [
        (1.0, True, Verdict.CONVERGED),
        (1.0, False, Verdict.NOT_CONVERGED),
        (0.509, True, Verdict.AT_BOUND),
        (1.991, False, Verdict.AT_BOUND),
        (0.511, True, Verdict.CONVERGED),
    ],
)
def test_of_an_estimate(value: float, converged: bool, expected: Verdict) -> None:
    """At a bound means closer than a tenth of sigma, converged or not."""
    unknown = Unknown(name="a", centre=1.0, scale=1.0, lower=0.5, upper=2.0, kind=UnknownKind.PARAMETER)
    assert estimate_verdict(unknown, value, 0.1, converged=converged) is expected


def test_the_first_verdict_that_applies() -> None:
    """Without other statements an estimate has converged, is not doubtful and needs no excitation."""
    unknown = Unknown(name="a", centre=1.0, scale=1.0, lower=0.5, upper=2.0, kind=UnknownKind.PARAMETER)
    assert estimate_verdict(unknown, 1.0, 0.1) is Verdict.CONVERGED
    assert estimate_verdict(unknown, 1.0, 0.1, doubtful=True) is Verdict.DOUBTFUL
    assert estimate_verdict(unknown, 1.0, 0.1, doubtful=True, converged=False) is Verdict.NOT_CONVERGED
    assert estimate_verdict(unknown, 0.5, 0.1, doubtful=True, converged=False) is Verdict.AT_BOUND
    assert estimate_verdict(unknown, 0.5, 0.1, excited=0.1) is Verdict.NOT_EXCITED
    assert estimate_verdict(unknown, 1.0, 0.1, excited=0.101) is Verdict.CONVERGED
    assert estimate_verdict(unknown, 1.0, math.nan, excited=0.1) is Verdict.NOT_EXCITED


def test_limits_of_the_information() -> None:
    """A sigma at the limit is uninformed, a conditional sigma at the limit is not excited."""
    posterior = ScaledPosterior.from_information(("a", "b"), np.diag([1.0, 3.0]))
    (a, b), kept = posterior.sigma, [posterior.conditional_sigma(i) for i in (0, 1)]
    assert kept == pytest.approx([a, b])
    assert information_verdicts(posterior, [0, 1], b) == dict.fromkeys((0, 1), Verdict.NOT_EXCITED)
    assert information_verdicts(posterior, [0, 1], a) == {0: Verdict.NOT_IDENTIFIABLE, 1: Verdict.CONVERGED}
    assert information_verdicts(posterior, [0], b) == {0: Verdict.NOT_EXCITED}


def test_of_an_uncertain_parameter() -> None:
    """Below the limit it is informed."""
    for sigma, verdict in ((0.599, Verdict.CONVERGED), (0.6, Verdict.NOT_EXCITED)):
        assert uncertain_verdict(sigma, 0.6) is verdict
