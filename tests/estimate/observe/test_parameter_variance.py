"""The compiled sensitivities against differences of two filters with the same gains."""

import numpy as np
import pytest

from fifthwheel.estimate.filters import Noise
from fifthwheel.estimate.filters.model import sizes, unpack_array
from fifthwheel.estimate.observe import monitor
from fifthwheel.estimate.observe.observer_step import reported_signals
from fifthwheel.estimate.observe.parameter_variance import Sensitivities, SigmaPoints
from fifthwheel.estimate.observe.uncertainty import Uncertainty
from fifthwheel.estimate.stream import stream_segments
from tests.estimate.filters.examples import run_kalman
from tests.estimate.observe.exact import TRUCK
from tests.estimate.observe.test_stream import LANE_CHANGES, observer

NAMES = (
    "tractor.front.cornering_stiffness",
    "semitrailer.cog",
    "yaw_rate.tractor.gain",
    "steer.tractor.front.offset",
    "bank.road",
)
SIGMA = np.array([1e3, 0.01, 0.002, 1e-4, 0.02])


@pytest.mark.slow
def test_variance_is_that_of_filters_with_the_same_gains() -> None:
    o = observer(gate=np.inf)._model
    model, report = o.model, o.report
    points = SigmaPoints.of(o, Uncertainty(names=NAMES, covariance=np.diag(SIGMA**2)))
    constant = o.constant(gate=np.inf)
    _, (segment, *_) = stream_segments(LANE_CHANGES.cut(0, 1.5), o.stream, o.step_limit)
    start, rows = o.start(segment.first), segment.rows[:]
    n, n_d, _, n_c, m = sizes(model)
    reported = len(report.outputs)
    assert report.outputs == reported_signals(TRUCK, roll=model.roll)

    def split(constant: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        first = n_c + n * (n + 1) // 2 + m + 1
        return constant[:n_c], constant[first : first + len(report.known)]

    c, _ = split(constant)
    Q, R = unpack_array(constant[n_c : n_c + n * (n + 1) // 2], n), constant[n_c + n * (n + 1) // 2 :][:m]
    noise = Noise(process=Q, measurement=R)
    run = run_kalman(model, rows, p=np.zeros(0), c=c, noise=noise, x0=start[:n], P0=unpack_array(start[n:-n], n))
    gains = []  # P H' / R of the given parameters, 0 for missing measurements
    for row, P in zip(rows, run.covariance, strict=True):
        d = row[1 : 1 + n_d]
        at_zero = model.observation(np.zeros(n), d, np.zeros(0), c)
        H = np.column_stack([np.array(model.observation(e, d, np.zeros(0), c) - at_zero) for e in np.eye(n)])
        gains.append(row[1 + n_d + m :] * (P @ H.T / R))

    def follow(constant: np.ndarray, shift: np.ndarray) -> np.ndarray:
        """Reported signals of the filter with other parameters and these gains."""
        (c_changed, c_report), x, results = split(constant), start[:n] + shift, []
        for row, gain in zip(rows, gains, strict=True):
            dt, d, y = row[0], row[1 : 1 + n_d], row[1 + n_d : 1 + n_d + m]
            x = np.array(model.transition(x, dt, d, np.zeros(0), c_changed)).ravel()
            x = x + gain @ (y - np.array(model.observation(x, d, np.zeros(0), c_changed)).ravel())
            results.append(np.array(report.observation(x, d, np.zeros(0), c_report)).ravel())
        return np.array(results)

    expected = np.zeros((len(rows), reported))
    effects = o.effects(segment.first)
    shifts = points.steps[:, None] * (points.unknowns @ effects)
    pairs_of_constants = zip(points.constants[::2], points.constants[1::2], strict=True)
    for (plus, minus), step, shift in zip(pairs_of_constants, points.steps, shifts, strict=True):
        expected += ((follow(plus, shift) - follow(minus, -shift)) / (2 * step)) ** 2
    assert points.with_bank
    time, settings = segment.rows.time, o.constant(gate=np.inf)
    _, output = o.scan(np.append(start, monitor.START), rows, settings)
    sensitivities = (
        Sensitivities(o, changed, segment.first, start[:n], time[0])
        for changed in (points._replace(with_bank=False), points)
    )
    actual, other = (
        np.concatenate([s.variance(time[part], rows[part], output[part]) for part in (slice(120), slice(120, None))])
        for s in sensitivities
    )
    assert (other == actual).all()  # the bank is exact
    scale = np.sqrt(expected.max(axis=0))
    assert len(rows) == 151
    at_once = slice(100)  # after this second, the derivatives are constant for 40 ms, and the changes interpolated
    np.testing.assert_allclose(np.sqrt(actual)[at_once] / scale, np.sqrt(expected)[at_once] / scale, atol=2e-3)
    np.testing.assert_allclose(np.sqrt(actual) / scale, np.sqrt(expected) / scale, atol=0.01)
    assert (scale > 0).all()
