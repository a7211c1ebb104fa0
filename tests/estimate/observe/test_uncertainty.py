"""Sigmas with uncertain parameters against the truth, against changed vehicles and against Monte Carlo."""

import json

import numpy as np
import pytest

from fifthwheel.base.errors import SignalError
from fifthwheel.estimate.observe import Observer, ObserverSettings, Status, Uncertainty
from fifthwheel.estimate.observe.observer_model import ObserverModel
from fifthwheel.model.simulate import simulate
from tests.estimate.observe.conftest import EXACT, ROLLS, STEER, YAWS, batched
from tests.estimate.observe.exact import OUTPUTS, TRUCK, exact_system, lane_change_steer, simulate_exact
from tests.estimate.observe.test_smoothing import columns
from tests.estimate.observe.test_stream import LANE_CHANGES, SCENARIOS, observer

VALUES = TRUCK.parameters()
OFFSET = f"{STEER}.offset"
TYRES = tuple(f"{group}.cornering_stiffness" for group in ("tractor.front", "tractor.drive", "semitrailer"))
NAMES = (*TYRES, OFFSET)
SIGMA = np.array([*[0.05 * VALUES[name] for name in TYRES], 0.002])
TYRES_AND_OFFSET = Uncertainty(names=NAMES, covariance=np.diag(SIGMA**2))
both_methods = pytest.mark.parametrize("method", ["batch", "smooth"])


def single(name: str, sigma: float) -> Uncertainty:
    return Uncertainty(names=(name,), covariance=np.array([[sigma**2]]))


def variances(states) -> dict[str, np.ndarray]:
    return {name: sigma**2 for name, sigma in states.sigma.items()}


@pytest.mark.slow
def test_coverage_of_the_intervals():
    """Random vehicles, observed with the nominal vehicle: coverage of the 90 % intervals over all samples."""
    random = np.random.default_rng(8)
    time = np.arange(300) / 50
    steer, o = lane_change_steer(time), Observer(TRUCK, {"speed", STEER, *OUTPUTS}, ObserverSettings(**EXACT))
    coverage: dict[str, list[list[float]]] = {}
    for _ in range(100):
        z = random.normal(size=len(NAMES))
        stiff = {name: VALUES[name] * np.exp(0.05 * factor) for name, factor in zip(TYRES, z, strict=False)}
        record = simulate_exact(exact_system(time, steer[0], values=stiff), time, steer, random, offset=0.002 * z[-1])
        with_uncertainty, without = (o.batch(record, u) for u in (TYRES_AND_OFFSET, None))
        for name, truth in record.reference.items():
            error = np.abs(with_uncertainty.values[name] - truth)
            cover = [np.mean(error < 1.645 * states.sigma[name]) for states in (with_uncertainty, without)]
            coverage.setdefault(name, []).append(cover)
    for name, cover in coverage.items():
        with_uncertainty, without = np.mean(cover, axis=0)
        assert 0.85 < with_uncertainty < 0.95, (name, with_uncertainty)
        assert without < 0.5, (name, without)


SINGLE = {
    "tractor.front.cornering_stiffness": 0.1,
    "semitrailer.payload.height": 0.2,
    "tractor.roll_axis_height": 0.1,
    "semitrailer.relaxation_length": 0.3,
    "semitrailer.cog": None,
    OFFSET: None,
    f"{STEER}.gain": None,
    f"{STEER}.delay": None,
    "yaw_rate.tractor.gain": None,
    "roll_rate.semitrailer.offset": None,
}
"""Sigma of the logarithm of each uncertain name, or None for a sigma of 0.02 in its unit."""


@pytest.fixture
def one_start(monkeypatch):
    """Every observer starts at the state of the nominal vehicle, with its own offset of the steering."""
    nominal = observer()._model
    offset, n = nominal.model.unknowns.index(OFFSET), len(nominal.model.states)

    def start(other, inputs, suspect=False):
        first = nominal_start(inputs)
        first[:n] += other.settings.sensor_errors.get(OFFSET, 0.0) * nominal.effects(inputs)[offset]
        return first

    nominal_start = nominal.start
    monkeypatch.setattr(ObserverModel, "start", start)


@pytest.mark.slow
@both_methods
@pytest.mark.parametrize("name", SINGLE)
@pytest.mark.usefixtures("one_start")
def test_one_uncertain_name_equals_two_changed_vehicles(name, method):
    """New observers of two changed vehicles give the contribution to the variance.

    That of the filter leaves out the change of the gain; see `parameter_variance`.
    """
    settings = {"gate": 1e6, "process_noise": 0.1}
    relative = SINGLE[name]
    sigma = 0.005 if relative is None else relative * VALUES[name]  # an offset of 0.02 rad would restart the filter
    o = observer(**settings)
    plain, actual = getattr(o, method)(LANE_CHANGES), getattr(o, method)(LANE_CHANGES, single(name, sigma))
    reported = []
    for sign in (1, -1):
        known = VALUES.get(name, float(name.endswith(".gain")))
        value = known + sign * sigma if relative is None else known * np.exp(sign * relative)
        if name in VALUES:
            other = Observer(TRUCK.replace({name: value}), LANE_CHANGES.signals, ObserverSettings(**EXACT, **settings))
        else:
            other = observer(**settings, sensor_errors={name: value})
        reported.append(getattr(other, method)(LANE_CHANGES).values)
    increase = 0.0
    for signal in plain.values:
        np.testing.assert_array_equal(actual.values[signal], plain.values[signal])
        half = (reported[0][signal] - reported[1][signal]) / 2
        expected = np.sqrt(plain.sigma[signal] ** 2 + half**2)
        if method == "smooth":
            np.testing.assert_allclose(actual.sigma[signal], expected, rtol=1e-6, err_msg=signal)
        else:
            rms, expected_rms = (np.sqrt(np.mean(values**2)) for values in (actual.sigma[signal], expected))
            assert rms == pytest.approx(expected_rms, rel=0.1), signal
        increase = max(increase, np.max(actual.sigma[signal] / plain.sigma[signal]))
    assert increase > 1.001


@pytest.mark.slow
@both_methods
@pytest.mark.usefixtures("one_start")
def test_correlated_parameters_equal_monte_carlo(method):
    """The variance of the results of 30 observers with jointly random parameters."""
    correlation = np.eye(4)
    correlation[0, 1] = correlation[1, 0] = 0.8
    correlation[2, 3] = correlation[3, 2] = -0.6
    sigma = SIGMA / 4  # small, because the effects of tyres and steer offset multiply: this vehicle is nearly neutral
    u = Uncertainty(names=NAMES, covariance=correlation * np.outer(sigma, sigma))
    record, gate = LANE_CHANGES.cut(0, 5), 1e6
    plain, actual = (getattr(observer(gate=gate), method)(record, uncertainty) for uncertainty in (None, u))
    samples = np.random.default_rng(3).normal(size=(30, 4))
    samples -= samples.mean(axis=0)  # exact mean and covariance, so that only nonlinearity remains
    samples = samples @ np.linalg.inv(np.linalg.cholesky(np.cov(samples.T, bias=True))).T
    results: dict[str, list[np.ndarray]] = {}
    for z in sigma * (samples @ np.linalg.cholesky(correlation).T):
        stiff = {name: VALUES[name] * np.exp(x / VALUES[name]) for name, x in zip(TYRES, z, strict=False)}
        other = Observer(
            TRUCK.replace(stiff), record.signals, ObserverSettings(sensor_errors={OFFSET: z[3]}, gate=gate, **EXACT)
        )
        for signal, values in getattr(other, method)(record).values.items():
            results.setdefault(signal, []).append(values)
    for signal, values in results.items():
        spread = np.std(values, axis=0)
        contribution = np.sqrt(np.maximum(actual.sigma[signal] ** 2 - plain.sigma[signal] ** 2, 0.0))
        assert np.sqrt(np.mean(contribution**2) / np.mean(spread**2)) == pytest.approx(1, abs=0.03), signal
        if method == "smooth":  # at single samples, a filter's contribution leaves out the change of the gain
            assert np.abs(contribution - spread).max() < 0.15 * spread.max(), signal


@both_methods
def test_zero_uncertainty_changes_nothing(method):
    o = observer()
    plain = columns(getattr(o, method)(LANE_CHANGES))
    zero = Uncertainty(names=NAMES, covariance=np.zeros((4, 4)))
    empty = Uncertainty(names=(), covariance=np.zeros((0, 0)))
    for u in (zero, empty):
        actual = columns(getattr(o, method)(LANE_CHANGES, u))
        for name in plain:
            np.testing.assert_array_equal(actual[name], plain[name])


@pytest.mark.slow
@both_methods
@pytest.mark.parametrize("name", ["slow and missing", "coasting", "gap in time", "irregular", "spiked"])
def test_uncertainty_changes_only_sigmas(name, method):
    record, o = SCENARIOS[name], observer()
    plain, actual = (getattr(o, method)(record, u) for u in (None, TYRES_AND_OFFSET))
    np.testing.assert_array_equal(actual.status, plain.status)
    valid = np.isin(actual.status, [Status.OK, Status.COASTING, Status.SETTLING])
    for signal in plain.values:
        np.testing.assert_array_equal(actual.values[signal], plain.values[signal])
        assert np.isfinite(actual.sigma[signal][valid]).all(), signal
        assert np.isnan(actual.sigma[signal][~valid]).all(), signal
        assert (actual.sigma[signal][valid] >= plain.sigma[signal][valid]).all(), signal
    for signal in plain.innovation:
        np.testing.assert_array_equal(actual.innovation_sigma[signal], plain.innovation_sigma[signal])


EXTREME = {
    "ten times the stiffness": single(TYRES[0], 10 * VALUES[TYRES[0]]),
    "an unknown roll stiffness": single("semitrailer.roll_stiffness", 1e12),
    "a steer offset of a right angle": single(OFFSET, 1.6),
    "an unknown gain": single(f"{STEER}.gain", 5.0),
    "two fully correlated names": Uncertainty(names=TYRES[:2], covariance=np.outer(SIGMA[:2], SIGMA[:2])),
    "a negligible sigma": single(TYRES[0], 1e-9),
    "an uncertain length": single("semitrailer.payload.floor_height", 0.3),
    "everything": Uncertainty(
        names=tuple(VALUES), covariance=np.diag([(0.3 * v) ** 2 + 1e-6 for v in VALUES.values()])
    ),
}


@pytest.mark.slow
@both_methods
@pytest.mark.parametrize("case", EXTREME)
def test_extreme_uncertainty_gives_finite_sigmas(case, method):
    record, o = SCENARIOS["slow and missing"], observer()
    plain, actual = (getattr(o, method)(record, u) for u in (None, EXTREME[case]))
    valid = np.isin(actual.status, [Status.OK, Status.COASTING, Status.SETTLING])
    for signal in plain.values:
        np.testing.assert_array_equal(actual.values[signal], plain.values[signal])
        assert np.isfinite(actual.sigma[signal][valid]).all(), signal
        assert (actual.sigma[signal][valid] >= plain.sigma[signal][valid]).all(), signal


def test_twice_the_sigma_gives_four_times_the_variance():
    """For quantities with a linear effect, also where a column is shortened."""
    o = observer(gate=1e6)
    plain = variances(o.batch(LANE_CHANGES))
    for name, sigma, accuracy in (  # the changes are differences of 1e-6 of a sigma
        (OFFSET, 0.001, 1e-6),
        (TYRES[2], 0.01 * VALUES[TYRES[2]], 1e-3),
        (TYRES[2], VALUES[TYRES[2]], 1e-5),
    ):
        small, large = (variances(o.batch(LANE_CHANGES, single(name, s))) for s in (sigma, 2 * sigma))
        for signal, variance in plain.items():
            contribution = small[signal] - variance
            np.testing.assert_allclose(
                large[signal] - variance, 4 * contribution, rtol=accuracy, atol=accuracy * contribution.max()
            )


def test_position_of_sideslip_with_an_uncertain_cog(lane_changes):
    """Sideslip under the CoG moves with the CoG; sideslip at a given position does not."""
    u = single("semitrailer.cog", 0.3)
    at_cog, at_position = (
        Observer(TRUCK, lane_changes.signals, ObserverSettings(positions=positions, gate=1e6, **EXACT))
        for positions in ({}, {"sideslip.semitrailer": TRUCK.unit("semitrailer").cog})
    )
    np.testing.assert_array_equal(
        at_cog.batch(lane_changes).sigma["sideslip.semitrailer"],
        at_position.batch(lane_changes).sigma["sideslip.semitrailer"],
    )
    one_sigma, other = (o.batch(lane_changes, u).sigma["sideslip.semitrailer"] for o in (at_cog, at_position))
    assert np.abs(one_sigma - other).max() > 1e-4


def test_errors_of_unused_sensors_have_no_effect():
    u = Uncertainty(
        names=(*NAMES, f"{ROLLS[1]}.offset", "steer.semitrailer.rear.gain", "articulation.semitrailer.offset"),
        covariance=np.diag([*SIGMA**2, 1.0, 1.0, 1.0]),
    )
    record = simulate(TRUCK, count=1, roll=False)
    o = Observer(TRUCK, {"speed", STEER, *YAWS}, ObserverSettings(**EXACT))
    for name, sigma in o.batch(record, TYRES_AND_OFFSET).sigma.items():
        np.testing.assert_array_equal(o.batch(record, u).sigma[name], sigma)


@pytest.mark.slow
def test_uncertainty_of_one_log():
    """An offset "<name>@<log>" applies to that log only."""
    u = Uncertainty(
        names=(TYRES[0], f"{OFFSET}@{LANE_CHANGES.name}", f"{OFFSET}@other"),
        covariance=np.diag([SIGMA[0] ** 2, 1e-8, 1.0]),
    )
    of_this_log = Uncertainty(names=(TYRES[0], OFFSET), covariance=np.diag([SIGMA[0] ** 2, 1e-8]))
    assert u.of_log("other").names == (TYRES[0], OFFSET)
    assert u.of_log("third").names == (TYRES[0],)
    for name, sigma in observer().batch(LANE_CHANGES, of_this_log).sigma.items():
        np.testing.assert_array_equal(observer().batch(LANE_CHANGES, u).sigma[name], sigma)


def test_the_covariance_as_a_frame():
    frame = Uncertainty(names=("tractor.mass", OFFSET), covariance=[[4.0, -0.1], [-0.1, 1.0]]).to_pandas()
    assert frame.loc["tractor.mass", OFFSET] == frame.loc[OFFSET, "tractor.mass"] == -0.1
    assert frame.loc["tractor.mass", "tractor.mass"] == 4.0


def test_batch_with_uncertainty_does_not_change_the_stream():
    o = observer()
    before, batch_result = o.save(), batched(o, LANE_CHANGES)
    o.batch(LANE_CHANGES, TYRES_AND_OFFSET)
    assert o.save() == before
    np.testing.assert_array_equal(batched(o, LANE_CHANGES)[YAWS[0]], batch_result[YAWS[0]])


def test_json_round_trip():
    data = json.loads(json.dumps(TYRES_AND_OFFSET.as_dict()))
    restored = Uncertainty.from_dict(data)
    assert restored.names == NAMES
    np.testing.assert_array_equal(restored.covariance, TYRES_AND_OFFSET.covariance)
    assert Uncertainty.from_dict({"names": [], "covariance": []}).covariance.shape == (0, 0)


def test_columns_are_a_square_root_of_the_covariance():
    random = np.random.default_rng(0)
    root = random.normal(size=(6, 6)) * 10.0 ** np.arange(6)[:, None]
    u = Uncertainty(names=tuple("abcdef"), covariance=root @ root.T)
    np.testing.assert_allclose(u.columns() @ u.columns().T, u.covariance, rtol=1e-4, atol=0)
    assert Uncertainty(names=("a", "b"), covariance=np.ones((2, 2))).columns().shape == (2, 1)


@pytest.mark.parametrize(
    ("data", "message"),
    [
        ({"names": ["a", "a"], "covariance": [[1, 0], [0, 1]]}, "a occurs twice"),
        ({"names": ["a"], "covariance": [[1, 0], [0, 1]]}, "1 by 1"),
        ({"names": ["a", "b"], "covariance": [[1, 0.5], [0, 1]]}, "symmetric"),
        ({"names": ["a", "b"], "covariance": [[1, 2], [2, 1]]}, "beyond 1"),
        ({"names": ["a"], "covariance": [[-1]]}, "negative variance"),
        ({"names": ["a", "b"], "covariance": [[0, 1], [1, 1]]}, "beyond 1"),
        ({"names": list("abc"), "covariance": [[1, -0.9, -0.9], [-0.9, 1, -0.9], [-0.9, -0.9, 1]]}, "eigenvalue"),
        ({"names": ["a", "b"], "covariance": [[1, None], [None, 1]]}, "not finite"),
        ({"names": ["a", "b"], "covariance": [[1], [0, 1]]}, "rows of numbers"),
        ({"names": ["a"]}, "names and a covariance"),
        ([1, 2], "names and a covariance"),
    ],
)  # fmt: skip
def test_invalid_covariance_is_refused(data, message):
    with pytest.raises(SignalError, match=message):
        Uncertainty.from_dict(data)


@pytest.mark.parametrize(
    "name", ["tractor.front.cornering_stifness", "yaw_rate.dolly.offset", "yaw_rate.tractor.delay"]
)
def test_unknown_name_is_refused(name):
    with pytest.raises(SignalError, match=f"{name}: uncertain, but"):
        observer().batch(LANE_CHANGES, single(name, 1.0))
