"""Sigmas with uncertain parameters against the truth, against changed vehicles and against Monte Carlo."""

import json

import numpy as np
import pytest

from fifthwheel.base.errors import SignalError
from fifthwheel.estimate.observe import Observer, ObserverSettings, Status, Uncertainty
from fifthwheel.estimate.observe.observer_model import ObserverModel
from fifthwheel.model.simulate import simulate
from tests.estimate.observe.conftest import EXACT, ROLLS, STEER, YAWS, assert_same
from tests.estimate.observe.exact import TRUCK
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
@pytest.mark.usefixtures("one_start")
def test_one_direction_of_uncertainty_equals_two_changed_vehicles():
    """New observers of two changed vehicles give the contribution to the variance of smoothed states.

    Relative changes of a tyre and of a position with it, fully correlated, and changes of sensor errors.
    """
    settings = {"gate": 1e6, "process_noise": 0.1}
    o, tyre = observer(**settings), TYRES[0]
    plain = o.smooth(LANE_CHANGES)
    for names, sigma in (
        ((tyre, "semitrailer.payload.height"), (0.1 * VALUES[tyre], 0.2 * VALUES["semitrailer.payload.height"])),
        (("semitrailer.cog",), (0.005,)),
        ((OFFSET, f"{STEER}.delay"), (0.005, 0.005)),
        (("yaw_rate.tractor.gain", "roll_rate.semitrailer.offset"), (0.005, 0.005)),
    ):
        actual = o.smooth(LANE_CHANGES, Uncertainty(names=names, covariance=np.outer(sigma, sigma)))
        found = []
        for sign in (1, -1):
            vehicle, errors = {}, {}
            for name, size in zip(names, sigma, strict=True):
                if name in VALUES and name != "semitrailer.cog":
                    vehicle[name] = VALUES[name] * np.exp(sign * size / VALUES[name])
                elif name in VALUES:
                    vehicle[name] = VALUES[name] + sign * size
                else:
                    errors[name] = float(name.endswith(".gain")) + sign * size
            known = ObserverSettings(**EXACT, **settings, sensor_errors=errors)
            found.append(Observer(TRUCK.replace(vehicle), LANE_CHANGES.signals, known).smooth(LANE_CHANGES).values)
        for signal in plain.values:
            np.testing.assert_array_equal(actual.values[signal], plain.values[signal])
            expected = np.sqrt(plain.sigma[signal] ** 2 + ((found[0][signal] - found[1][signal]) / 2) ** 2)
            np.testing.assert_allclose(actual.sigma[signal], expected, rtol=1e-6, err_msg=f"{names} {signal}")
        assert max(np.max(actual.sigma[signal] / plain.sigma[signal]) for signal in plain.sigma) > 1.001


@both_methods
def test_contributions_add_and_grow_with_the_variance(method):
    """Twice the sigma, four times the contribution; two independent names contribute their sum; no sigma none."""
    o = observer(gate=1e6)
    plain = getattr(o, method)(LANE_CHANGES)

    def contribution(*pairs: tuple[str, float]) -> dict[str, np.ndarray]:
        names, sigma = zip(*pairs, strict=True)
        uncertainty = Uncertainty(names=names, covariance=np.diag(np.square(sigma)))
        found = getattr(o, method)(LANE_CHANGES, uncertainty).sigma
        return {name: values**2 - plain.sigma[name] ** 2 for name, values in found.items()}

    tyre, offset = (TYRES[2], 0.01 * VALUES[TYRES[2]]), (OFFSET, 0.001)
    one, other, both = contribution(tyre), contribution(offset), contribution(tyre, offset)
    for factor, accuracy in ((1, 1e-3), (100, 1e-5)):  # the second column is shortened
        small, large = (contribution((tyre[0], k * factor * tyre[1])) for k in (1, 2))
        for name, value in small.items():
            np.testing.assert_allclose(large[name], 4 * value, rtol=accuracy, atol=accuracy * value.max())
    for name, value in both.items():
        np.testing.assert_allclose(value, one[name] + other[name], rtol=1e-3, atol=1e-3 * value.max())
    none = getattr(o, method)(LANE_CHANGES, Uncertainty(names=NAMES, covariance=np.zeros((4, 4))))
    assert_same(columns(none), columns(plain))


EXTREME = {
    "tyres and offset": TYRES_AND_OFFSET,
    "a steer offset of a right angle": single(OFFSET, 1.6),
    "two fully correlated names": Uncertainty(names=TYRES[:2], covariance=np.outer(SIGMA[:2], SIGMA[:2])),
    "everything": Uncertainty(
        names=tuple(VALUES), covariance=np.diag([(0.3 * v) ** 2 + 1e-6 for v in VALUES.values()])
    ),
}


@pytest.mark.slow
@both_methods
def test_uncertainty_changes_only_sigmas(method):
    """Which are finite and not smaller, also where the uncertainty is extreme and the record is damaged."""
    record, o = SCENARIOS["slow and missing"], observer()
    plain = getattr(o, method)(record)
    valid = np.isin(plain.status, [Status.OK, Status.COASTING, Status.SETTLING])
    for case, uncertainty in EXTREME.items():
        actual = getattr(o, method)(record, uncertainty)
        np.testing.assert_array_equal(actual.status, plain.status)
        for signal, sigma in actual.sigma.items():
            np.testing.assert_array_equal(actual.values[signal], plain.values[signal])
            assert np.isfinite(sigma[valid]).all(), (case, signal)
            assert np.isnan(sigma[~valid]).all(), (case, signal)
            assert (sigma[valid] >= plain.sigma[signal][valid]).all(), (case, signal)
        for signal in plain.innovation:
            np.testing.assert_array_equal(actual.innovation_sigma[signal], plain.innovation_sigma[signal])


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


def test_unknown_name_is_refused():
    for name in ("tractor.front.cornering_stifness", "yaw_rate.dolly.offset", "yaw_rate.tractor.delay"):
        with pytest.raises(SignalError, match=f"{name}: uncertain, but"):
            observer().batch(LANE_CHANGES, single(name, 1.0))
