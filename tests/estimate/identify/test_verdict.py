"""The rules that decide a verdict."""

import math

import numpy as np
import pytest

from fifthwheel.estimate.identify.one_stage.posterior import ScaledPosterior
from fifthwheel.estimate.identify.unknowns.parameters import lacks_roll_rate
from fifthwheel.estimate.identify.unknowns.unknown import Unknown
from fifthwheel.estimate.identify.verdict import (
    Verdict,
    estimate_verdict,
    remaining_fraction,
    uncertain_verdict,
    uninformed_parameters,
)

STIFFNESS, HEIGHT = "tractor.front.cornering_stiffness", "semitrailer.payload.height"
YAW_RATES = ("yaw_rate.tractor", "yaw_rate.semitrailer")
ALL_RATES = (*YAW_RATES, "roll_rate.semitrailer")
LIMIT = 0.7


@pytest.mark.parametrize(
    ("stiffness", "height", "both", "channels", "expected"),
    [
        (100.0, 100.0, 0.0, ALL_RATES, {}),
        (100.0, 100.0, 0.0, YAW_RATES, {HEIGHT: Verdict.NOT_IDENTIFIABLE}),
        (100.0, 100.0, 0.0, (*YAW_RATES, "roll_rate.tractor"), {HEIGHT: Verdict.NOT_IDENTIFIABLE}),
        (0.0, 0.0, 0.0, YAW_RATES, {STIFFNESS: Verdict.NOT_EXCITED, HEIGHT: Verdict.NOT_IDENTIFIABLE}),
        (0.0, 100.0, 0.0, ALL_RATES, {STIFFNESS: Verdict.NOT_EXCITED}),
        (0.0, 0.0, 100.0, ALL_RATES, dict.fromkeys((STIFFNESS, HEIGHT), Verdict.NOT_IDENTIFIABLE)),
        (0.0, 100.0, 100.0, ALL_RATES, {}),
    ],
)
def test_uninformed(
    stiffness: float, height: float, both: float, channels: tuple[str, ...], expected: dict[str, Verdict]
) -> None:
    """By the information on each and on their sum, each on its own; a payload height needs the roll rate of its unit,
    whatever the information says."""
    posterior = ScaledPosterior.from_information((STIFFNESS, HEIGHT), np.diag([stiffness, height]) + both)
    without = [name for name in (STIFFNESS, HEIGHT) if lacks_roll_rate(name, channels)]
    remaining = dict(zip(posterior.names, posterior.sigma.tolist(), strict=True))
    assert uninformed_parameters(posterior, remaining, without, LIMIT) == expected


def test_the_first_verdict_that_applies() -> None:
    """At a bound means closer than a tenth of sigma, converged or not. Without other statements an estimate has
    converged, is not doubtful and needs no excitation."""
    unknown = Unknown(name="a", centre=1.0, scale=1.0, lower=0.5, upper=2.0, reported=True)
    for value, sigma, statements, expected in (
        (1.0, 0.1, {}, Verdict.CONVERGED),
        (1.0, 0.1, {"converged": False}, Verdict.NOT_CONVERGED),
        (0.509, 0.1, {}, Verdict.AT_BOUND),
        (1.991, 0.1, {"converged": False}, Verdict.AT_BOUND),
        (0.511, 0.1, {}, Verdict.CONVERGED),
        (1.0, 0.1, {"doubtful": True}, Verdict.DOUBTFUL),
        (1.0, 0.1, {"doubtful": True, "converged": False}, Verdict.NOT_CONVERGED),
        (0.5, 0.1, {"doubtful": True, "converged": False}, Verdict.AT_BOUND),
        (0.5, 0.1, {"excited": 0.1}, Verdict.NOT_EXCITED),
        (1.0, 0.1, {"excited": 0.101}, Verdict.CONVERGED),
        (1.0, math.nan, {"excited": 0.1}, Verdict.NOT_EXCITED),
    ):
        assert estimate_verdict(unknown, value, sigma, **statements) is expected, (value, statements)
    for sigma, verdict in ((0.599, Verdict.CONVERGED), (0.6, Verdict.NOT_EXCITED)):
        assert uncertain_verdict(sigma, 0.6) is verdict


def test_limits_of_the_information() -> None:
    """What remains at the limit is uninformed; with a conditional sigma of half the prior, here at 3, not excited."""
    for remaining, information, expected in (
        (0.699, 3.0, {}),
        (0.7, 3.0, {"a": Verdict.NOT_EXCITED}),
        (math.nan, 3.0, {"a": Verdict.NOT_EXCITED}),
        (0.7, 3.01, {"a": Verdict.NOT_IDENTIFIABLE}),
    ):
        posterior = ScaledPosterior.from_information(("a",), np.array([[information]]))
        assert uninformed_parameters(posterior, {"a": remaining}, (), LIMIT) == expected


@pytest.mark.parametrize(
    ("logarithmic", "value", "remaining"), [(True, 2.0, 0.4), (True, 5.0, 1.0), (True, 1.0, 0.4), (False, 5.0, 0.4)]
)
def test_what_remains_of_a_prior(logarithmic: bool, value: float, remaining: float) -> None:
    """Of a value or of its logarithm, the larger fraction: sigma grows with the value, that of the prior does not."""
    bounds = {"lower": 0.5, "upper": 20.0, "reported": True}
    unknown = Unknown(name="a", centre=2.0, scale=0.3, logarithmic=logarithmic, **bounds)
    assert remaining_fraction(unknown, value, 0.4) == pytest.approx(remaining)
    assert unknown.sigma(value, 0.4) / unknown.prior_sigma <= remaining * (1 + 1e-9)
    for excited, verdict in ((1.01 * remaining, Verdict.CONVERGED), (0.99 * remaining, Verdict.NOT_EXCITED)):
        assert estimate_verdict(unknown, value, 0.4, excited=excited) is verdict
