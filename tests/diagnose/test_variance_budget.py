"""The variance budget against a linear estimate whose variance is known in closed form."""

from dataclasses import replace

import numpy as np
import pytest

from fifthwheel.diagnose.variance_budget import dominant_terms, variance_budget
from fifthwheel.observe import Uncertainty


def test_fractions_are_those_of_a_linear_estimate(result):
    """With x = e + a c + b d, e, c, d independent, c contributes (a sigma_c)^2 to the variance of x."""
    x, c, d = (
        result.identification.parameters[0],
        *[e for e in result.identification.uncertain if e.verdict == "fixed"][:2],
    )
    jacobian = np.array([[1.0, 2.0, -0.5], [0, 1, 0], [0, 0, 1]])
    covariance = jacobian @ np.diag([0.3, 0.7, 1.1]) ** 2 @ jacobian.T
    known = Uncertainty(names=(x.name, c.name, d.name), covariance=covariance)
    budget = variance_budget(replace(result.identification, covariance=known), x.name)
    variance = 0.3**2 + (2 * 0.7) ** 2 + (0.5 * 1.1) ** 2
    assert [term.source for term in budget] == [c.name, d.name]
    assert [term.fraction for term in budget] == pytest.approx([1.4**2 / variance, 0.55**2 / variance])


def test_the_payload_height_depends_on_the_roll_axis(result):
    budget = variance_budget(result.identification, "semitrailer.payload.height")
    assert budget[0].source == "semitrailer.roll_axis_height"
    assert budget[0] in dominant_terms(result.identification)
    for e in result.identification.parameters:
        fractions = [term.fraction for term in variance_budget(result.identification, e.name)]
        assert fractions == sorted(fractions, reverse=True)
        assert sum(fractions) <= 1.001


def test_without_a_covariance_there_is_no_budget(result):
    identification = replace(result.identification, covariance=None)
    assert variance_budget(identification, "semitrailer.payload.height") == []
    assert dominant_terms(identification) == []
