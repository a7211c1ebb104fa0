"""Both sides of every limit of an observer, and its parts against plain formulas."""

import casadi as ca
import numpy as np
import pytest

from fifthwheel.base.errors import SignalError
from fifthwheel.estimate.filters.kalman import ChannelUpdate
from fifthwheel.estimate.observe import ObserverSettings, Status, Uncertainty
from fifthwheel.estimate.observe import monitor as monitor_module
from tests.estimate.observe.conftest import STEER

EDGE = 1e-6
ABOVE_0 = (
    *("min_speed", "coast", "max_gap", "gate", "max_nis", "nis_window"),
    *("max_steer_rate", "max_acceleration", "speed_smoothing"),
)


def reference_monitor(carry, innovations, variances, accepted, weight, dt, sudden, limit, window, restart_after):
    """The monitor in plain Python."""
    nis, elapsed, duration, agreed = carry[0], carry[1] + dt, carry[2], carry[3]
    used = [i for i, w in enumerate(weight) if w]
    later = bool(used) and dt > 0
    contradicts = later and any(innovations[i] ** 2 / variances[i] > 4.0**2 for i in used)
    again = 0 <= agreed < 10 and (contradicts or sudden)
    agreed = -20 if sudden else 10 if agreed == -1 and later else min(agreed + later, 10)
    settling = int(agreed < 10)
    if not used:
        return [nis, elapsed, duration + dt if duration >= 0 else duration, agreed], [settling, nis, int(again)]
    mean = np.mean([min(innovations[i] ** 2 / variances[i], limit) for i in used])
    nis += min(elapsed / (window + elapsed), 0.1) * (mean - nis)
    rejected = len(used) - sum(accepted[i] for i in used)
    if 2 * rejected < len(used) or rejected < min(len(used), 2):
        return [nis, 0, -1, agreed], [settling, nis, int(again)]
    lasted = duration + dt if duration >= 0 else -1
    return [nis, 0, max(lasted, 0), agreed], [settling, nis, int(again or lasted >= restart_after)]


@pytest.mark.slow
def test_the_monitor_equals_plain_python():
    """Of three channels, rejected and missing at random; at a long step the average has at least ten samples."""
    symbols = {name: ca.SX.sym(name, 3) for name in ("innovation", "variance", "accepted", "weight")}
    carried = ca.SX.sym("carry", len(monitor_module.START))
    dt, sudden, settings = ca.SX.sym("dt"), ca.SX.sym("sudden"), ca.SX.sym("settings", 2)
    columns = zip(*(ca.vertsplit(symbols[n]) for n in ("innovation", "variance", "accepted")), strict=True)
    fields = ("innovation", "variance", "accepted")
    channels = [ChannelUpdate(**dict(zip(fields, column, strict=True))) for column in columns]
    results = monitor_module.monitor(carried, channels, symbols["weight"], dt, sudden, ca.SX(36.0), settings)
    step = ca.Function("monitor", [*symbols.values(), carried, dt, sudden, settings], list(results))
    random, restarts, rejections, settled = np.random.default_rng(2), 0, set(), 0
    carry = expected = monitor_module.START
    for k in range(3000):
        innovation, variance = random.normal(size=3) * random.choice([1, 20], size=3), random.uniform(0.5, 2, 3)
        weight = (random.random(3) < 0.7).astype(float)
        if k % 300 > 250:
            innovation[:] = 50.0  # a disagreement that lasts
        if k % 300 < 100:
            innovation /= 20.0  # the state settles
        innovation *= weight
        accepted = weight * (innovation**2 / variance <= 36)
        gap, jump = random.choice([0.0, 0.01, 0.05, 2.0]), random.random() < 0.02
        carry, found = step(innovation, variance, accepted, weight, carry, gap, jump, [1.0, 0.1])
        arguments = (innovation, variance, accepted, weight, gap, jump, 36.0, 1.0, 0.1)
        expected, answer = reference_monitor(expected, *arguments)
        assert carry.full().ravel() == pytest.approx(expected)
        assert found.full().ravel() == pytest.approx(answer)
        restarts += answer[2]
        settled += not answer[0]
        rejections.add((int(weight.sum()), int(weight.sum() - accepted.sum())))
    assert restarts > 10
    assert settled > 100
    assert len(rejections) == 10  # every number of measured and rejected channels
    assert monitor_module.START.tolist() == [1.0, 0.0, -1.0, 0.0]
    assert monitor_module.after_restart(3.0).tolist() == [3.0, 0.0, -1.0, 0.0]


@pytest.mark.parametrize(
    ("name", "change", "dt", "expected"),
    [
        ("steer.tractor.front", 0.0053, 0.01, 1),
        ("steer.tractor.front", -0.0053, 0.01, 1),
        ("steer.tractor.front", 0.0051, 0.01, 0),
        ("steer.tractor.front", 0.0049, 0.001, 0),
        ("steer.tractor.front", 0.0061, 0.0, 0),
        ("speed", 1.01, 0.01, 1),
        ("speed", 0.99, 0.01, 0),
        ("speed", 2.9, 0.1, 0),
        ("speed_rate", 100.0, 0.01, 0),
    ],
)
def test_a_sudden_change_of_an_input(name, change, dt, expected):
    zero = ca.SX(0)
    assert float(ca.DM(monitor_module.sudden_change([name], zero, zero + change, ca.SX(dt)))) == expected


@pytest.mark.parametrize(
    ("values", "variances", "dt", "expected"),
    [
        ([600.0, -400.0], [1.0, 1.0], 0.01, 0),
        ([600.0, -401.0], [1.0, 1.0], 0.01, 1),
        ([0.0, 0.0], [5e5, -5e5], 0.01, 0),
        ([0.0, 0.0], [5e5, -5.1e5], 0.01, 1),
        ([np.nan, 0.0], [1.0, 1.0], 0.01, 1),
        ([0.0, 0.0], [1.0, np.nan], 0.01, 1),
        ([2e3, 0.0], [1.0, 1.0], 0.0, 0),  # a start
    ],
)
def test_a_state_that_no_truck_has_has_diverged(values, variances, dt, expected):
    """Above 1000 rad, rad/s or such a sigma, or not a number."""
    found = monitor_module.diverged(ca.SX(values), ca.SX(variances), ca.SX(dt))
    assert float(ca.DM(found)) == expected


def test_the_monitor_of_a_filter_sample_by_sample():
    """Of two channels with a gate of 3 sigma: a NIS of at most 9, and a restart after 0.2 s of disagreement."""
    settings = ObserverSettings(nis_window=0.5, restart_after=0.2, max_nis=4.0)
    found = monitor_module.Monitor(("speed", STEER), 2, 3.0, settings)
    found.start()
    assert (found.nis, found.excess, found.status(Status.OK)) == (1.0, 1.0, Status.SETTLING)
    still, weight = [20.0, 0.0], [1.0, 1.0]
    assert not found.update(0.0, still, still, [1.0, -1.0], weight)
    for _ in range(9):
        assert not found.update(0.1, still, still, [1.0, -1.0], weight)
        assert found.status(Status.OK) is Status.SETTLING
    assert not found.update(0.1, still, still, [1.0, -1.0], weight)
    assert (found.nis, found.status(Status.OK)) == (1.0, Status.OK)
    assert not found.update(0.1, still, still, [2.9, 0.0], weight)
    nis = 1 + 0.1 * (2.9**2 / 2 - 1)
    assert found.nis == pytest.approx(nis)
    assert {status.name: int(status) for status in Status} == {  # files and live answers contain the number
        "OK": 0,
        "COASTING": 1,
        "TOO_SLOW": 2,
        "INPUT_MISSING": 3,
        "INCONSISTENT": 4,
        "SETTLING": 5,
    }
    assert monitor_module.health(Status.COASTING, 1.0, 4.0, 4.0) is Status.COASTING, "what coasts does not settle"
    assert monitor_module.health(Status.COASTING, 1.0, 4.0 + EDGE, 4.0) is Status.INCONSISTENT
    saved, restarts = found.save(), []
    for _ in range(3):
        restarts.append(found.update(0.1, still, still, [-99.0, 99.0], weight))
        nis += 0.1 * (9 - nis)
        assert found.nis == pytest.approx(nis)
        assert found.excess == pytest.approx(max(nis / 1.5, 1.0))
    assert restarts == [False, False, True]
    other = monitor_module.Monitor(("speed", STEER), 2, 3.0, settings)
    other.resume(saved)
    assert [other.update(0.1, still, still, [-99.0, 99.0], weight) for _ in range(3)] == restarts
    assert other.save().tolist() == found.save().tolist()
    assert not other.update(0.1, still, [20.0, 0.2], [0.0, 0.0], weight)
    assert other.status(Status.OK) is Status.SETTLING, "the steer angle has changed suddenly"
    other.start(5.0)
    assert other.status(Status.OK) is Status.INCONSISTENT


@pytest.mark.parametrize(
    ("settings", "allowed"),
    [
        ({"hold": 0.0}, True),
        ({"hold": -EDGE}, False),
        ({"process_noise": 0.0}, True),
        ({"process_noise": -EDGE}, False),
        ({"restart_after": 0.0}, True),
        ({"restart_after": -EDGE}, False),
        *(({name: value}, value > 0) for name in ABOVE_0 for value in (EDGE, 0.0)),
        ({"speed_smoothing": float("nan")}, False),
        ({"friction": 0.0}, False),
        ({"friction": float("nan")}, False),
        ({"friction": 80.0}, False),
        ({"surroundings": {"brakes.drive_axle": 1.01}}, False),
        ({"gate": float("nan")}, False),
        ({"bank": EDGE}, True),
        ({"bank": 0.0}, True),
        ({"bank": -EDGE}, False),
        ({"bank": 1.0 - EDGE}, True),
        ({"bank": 1.0}, False),
        ({"noise": {"yaw_rate.a": EDGE}}, True),
        ({"noise": {"yaw_rate.a": 0.0}}, False),
        ({"noise": {"yaw_rate.a": float("inf")}}, False),
        ({"noise": {"yaw_rate.a": "1"}}, False),
        ({"sensor_errors": {"yaw_rate.a.offset": -1.0}}, True),
        ({"sensor_errors": {"yaw_rate.a.offset": float("nan")}}, False),
        ({"positions": {"sideslip.a": None}}, False),
        ({"positions": {"sideslip.a": -2.0}}, True),
    ],
    ids=str,
)
def test_ranges_of_the_settings(settings, allowed):
    if allowed:
        ObserverSettings(**settings)
        return
    name = next(iter(settings))
    with pytest.raises(SignalError, match=f"^{name}(, .*)?: expected"):
        ObserverSettings(**settings)


def test_negligible_directions_are_left_out():
    """Of the correlation matrix, a millionth of its trace; the variance of the names has no effect."""
    for difference, kept in ((0.9e-6, 1), (1.1e-6, 2)):  # what b has besides a has the variance 1 - r^2
        r = 1 - difference
        for scale in (np.ones(2), np.array([1e-6, 1e6])):
            covariance = np.array([[1, r], [r, 1]]) * np.outer(scale, scale)
            assert Uncertainty(names=("a", "b"), covariance=covariance).columns().shape == (2, kept)


def test_sigma_points_change_by_half_a_logarithm_at_most():
    """A longer column is shortened, and its step says by how much; other parameters change linearly."""
    values = {"a": 2.0, "b": -3.0}
    for sigma, step in ((0.99, 1.0), (1.01, 0.5 / 0.505), (4.0, 0.25)):
        (pair,) = Uncertainty(names=("a",), covariance=np.array([[sigma**2]])).pairs(values, {"a"})
        assert pair.step == pytest.approx(step)
        assert abs(np.log(pair.plus["a"] / 2.0)) == pytest.approx(sigma / 2 * step)
        assert pair.plus["a"] * pair.minus["a"] == pytest.approx(4.0)
    (pair,) = Uncertainty(names=("b",), covariance=np.array([[9e4]])).pairs(values, {"a"})
    assert pair.step == 1.0
    assert sorted((pair.plus["b"], pair.minus["b"])) == pytest.approx([-303.0, 297.0])


def test_which_matrices_are_covariances():
    """Symmetric to a millionth, with correlations up to 1, and without a negative eigenvalue."""

    def allowed(matrix):
        try:
            Uncertainty(names=tuple("abc"[: len(matrix)]), covariance=np.array(matrix))
        except SignalError:
            return False
        return True

    for unit in (1.0, 1e-8):
        assert allowed(unit * np.array([[1.0, 0.5 + 0.9e-6], [0.5, 1.0]]))
        assert not allowed(unit * np.array([[1.0, 0.5 + 1.1e-6], [0.5, 1.0]]))
        assert allowed(unit * np.array([[1.0, 1.0 + 0.5e-6], [1.0 + 0.5e-6, 1.0]]))
        assert not allowed(unit * np.array([[1.0, 1.0 + 3e-6], [1.0 + 3e-6, 1.0]]))
        assert not allowed(unit * np.array([[-1e-3, 0.0], [0.0, 1.0]]))
        assert allowed(unit * np.array([[0.0, 0.0], [0.0, 1.0]]))
    for r, possible in ((-0.499, True), (-0.501, False)):  # of three equal correlations at least -0.5
        assert allowed(np.full((3, 3), r) + (1 - r) * np.eye(3)) == possible
