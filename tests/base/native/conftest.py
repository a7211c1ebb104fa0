"""A separate cache for every test, and small steps."""

from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from fifthwheel.base.types import Array


@pytest.fixture(autouse=True)
def cache_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Folder of this test's machine code; it does not exist yet."""
    folder = tmp_path / "cache"
    monkeypatch.setenv("FIFTHWHEEL_CACHE", str(folder))
    return folder


def times(factor: float, name: str = "times") -> ca.Function:
    """carry + factor * constant * sample, all scalars; the output is the previous carry."""
    carry, sample, constant = (ca.SX.sym(word) for word in ("carry", "sample", "constant"))
    return ca.Function(name, [carry, sample, constant], [carry + factor * constant * sample, carry])


def oscillator() -> ca.Function:
    """A pendulum with two carries, two inputs, three constants and three outputs."""
    x, u, k = ca.SX.sym("x", 2), ca.SX.sym("u", 2), ca.SX.sym("k", 3)
    later = ca.vertcat(x[0] + u[1] * x[1], x[1] - u[1] * (k[0] * ca.sin(x[0]) + k[1] * x[1] - ca.exp(-k[2]) * u[0]))
    return ca.Function("oscillator", [x, u, k], [later, ca.vertcat(later[0], x[1], ca.fmax(x[0], k[2]))])


def interpreted(step: ca.Function, carry: Array, sample: Array, constant: Array) -> tuple[Array, Array]:
    """The result of `Scan`, computed by CasADi's interpreter."""
    rows = []
    for row in sample:
        carry, output = (np.array(value).ravel() for value in step(carry, row, constant))
        rows.append(output)
    return carry, np.array(rows).reshape(len(sample), step.numel_out(1))


def max_difference(actual: Array, expected: Array) -> float:
    """Largest difference, relative for values above one; NaN and infinities must be equal."""
    assert np.array_equal(np.isnan(actual), np.isnan(expected))
    assert np.array_equal(actual[np.isinf(expected)], expected[np.isinf(expected)])
    finite = np.isfinite(expected)
    if not finite.any():
        return 0.0
    a, b = actual[finite], expected[finite]
    return float((np.abs(a - b) / np.maximum(1.0, np.abs(b))).max())
