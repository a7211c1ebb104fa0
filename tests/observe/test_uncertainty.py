"""Sigma with what is not known of the truck: against the truth, other trucks, and a cloud of them."""

import json

import numpy as np
import pytest

from fifthwheel.errors import SignalError
from fifthwheel.observe import Observer, ObserverSettings, Status, Uncertainty
from fifthwheel.observe.known import Known
from fifthwheel.simulate import simulate

from .conftest import ROLLS, STEER, YAWS, batched
from .exact import OUTPUTS, TRUCK, drive, exact, lane_change
from .test_smoothing import columns
from .test_stream import DRIVE, SCENARIOS, observer

OWN = TRUCK.parameters()
ZERO = f"{STEER}.offset"
TYRES = tuple(f"{group}.cornering_stiffness" for group in ("tractor.front", "tractor.drive", "semitrailer"))
NAMES = (*TYRES, ZERO)
SIGMA = np.array([*[0.05 * OWN[name] for name in TYRES], 0.002])
TYRES_AND_ZERO = Uncertainty(names=NAMES, covariance=np.diag(SIGMA**2))
each = pytest.mark.parametrize("name", SCENARIOS)
both = pytest.mark.parametrize("how", ["batch", "smooth"])


def one(name: str, sigma: float) -> Uncertainty:
    return Uncertainty(names=(name,), covariance=np.array([[sigma**2]]))


def squares(states) -> dict[str, np.ndarray]:
    return {name: sigma**2 for name, sigma in states.sigma.items()}


@pytest.mark.parametrize(("how", "draws"), [("batch", 160), ("smooth", 100)])
def test_intervals_cover_what_they_promise(how, draws):
    """Trucks drawn from the uncertainty, observed with the nominal one: 90 % intervals, at all samples of all draws."""
    random = np.random.default_rng(8)
    time = np.arange(300) / 50
    steer, o = lane_change(time), Observer(TRUCK, {"speed", STEER, *OUTPUTS})
    inside: dict[str, list[list[float]]] = {}
    for _ in range(draws):
        drawn = random.normal(size=len(NAMES))
        stiff = {name: OWN[name] * np.exp(0.05 * z) for name, z in zip(TYRES, drawn, strict=False)}
        record = drive(exact(time, steer[0], values=stiff), time, steer, random, offset=0.002 * drawn[-1])
        with_it, without = (getattr(o, how)(record, u) for u in (TYRES_AND_ZERO, None))
        for name, truth in record.reference.items():
            error = np.abs(with_it.values[name] - truth)
            cover = [np.mean(error < 1.645 * states.sigma[name]) for states in (with_it, without)]
            inside.setdefault(name, []).append(cover)
    for name, cover in inside.items():
        known, unknown = np.mean(cover, axis=0)
        assert 0.85 < known < 0.95, (name, known)
        assert unknown < 0.5, (name, unknown)


SINGLE = {
    "tractor.front.cornering_stiffness": 0.1,
    "semitrailer.yaw_inertia": 0.2,
    "semitrailer.payload.height": 0.2,
    "semitrailer.roll_stiffness": 0.1,
    "tractor.roll_axis_height": 0.1,
    "semitrailer.relaxation_length": 0.3,
    "semitrailer.cog": None,
    "fifth_wheel.leading_position": None,
    ZERO: None,
    f"{STEER}.gain": None,
    f"{STEER}.delay": None,
    "yaw_rate.tractor.gain": None,
    "roll_rate.semitrailer.offset": None,
}
"""What is uncertain: by how much of its logarithm, or, where that is None, by 0.02 of its unit."""


@pytest.fixture
def one_start(monkeypatch):
    """Every observer starts where that of the nominal truck would."""
    nominal = observer()._known.start
    monkeypatch.setattr(Known, "start", lambda _, inputs: nominal(inputs))


@both
@pytest.mark.parametrize("name", SINGLE)
@pytest.mark.usefixtures("one_start")
def test_one_unknown_is_two_other_trucks(name, how):
    """Made afresh, with their own numbers in every place; neither needs the constants of the first."""
    settings = {"gate": 1e6, "process_noise": 0.1}
    part = SINGLE[name]
    sigma = 0.02 if part is None else part * OWN[name]
    o = observer(**settings)
    plain, found = getattr(o, how)(DRIVE), getattr(o, how)(DRIVE, one(name, sigma))
    told = []
    for sign in (1, -1):
        known = OWN.get(name, float(name.endswith(".gain")))
        value = known + sign * sigma if part is None else known * np.exp(sign * part)
        if name in OWN:
            other = Observer(TRUCK.replace({name: value}), DRIVE.signals, ObserverSettings(**settings))
        else:
            other = observer(**settings, zeros={name: value})
        told.append(getattr(other, how)(DRIVE).values)
    grown = 0.0
    for signal in plain.values:
        np.testing.assert_array_equal(found.values[signal], plain.values[signal])
        half = (told[0][signal] - told[1][signal]) / 2
        expected = np.sqrt(plain.sigma[signal] ** 2 + half**2)
        np.testing.assert_allclose(found.sigma[signal], expected, rtol=1e-6, err_msg=signal)
        grown = max(grown, np.max(found.sigma[signal] / plain.sigma[signal]))
    assert grown > 1.001


@both
@pytest.mark.usefixtures("one_start")
def test_a_cloud_of_trucks(how):
    """The variance of the answers of the same observer of many trucks, drawn jointly: correlations count."""
    correlation = np.eye(4)
    correlation[0, 1] = correlation[1, 0] = 0.8
    correlation[2, 3] = correlation[3, 2] = -0.6
    sigma = SIGMA / 4  # of more, products of tyres and steer zero show: this truck is nearly neutral
    u = Uncertainty(names=NAMES, covariance=correlation * np.outer(sigma, sigma))
    record, gate = DRIVE.cut(0, 5), 1e6
    plain, found = (getattr(observer(gate=gate), how)(record, some) for some in (None, u))
    drawn = np.random.default_rng(3).normal(size=(100, 4))
    drawn -= drawn.mean(axis=0)  # means and covariance as they should be: what is left is what is not linear
    drawn = drawn @ np.linalg.inv(np.linalg.cholesky(np.cov(drawn.T, bias=True))).T
    clouds: dict[str, list[np.ndarray]] = {}
    for z in sigma * (drawn @ np.linalg.cholesky(correlation).T):
        stiff = {name: OWN[name] * np.exp(x / OWN[name]) for name, x in zip(TYRES, z, strict=False)}
        other = Observer(TRUCK.replace(stiff), record.signals, ObserverSettings(zeros={ZERO: z[3]}, gate=gate))
        for signal, values in getattr(other, how)(record).values.items():
            clouds.setdefault(signal, []).append(values)
    for signal, cloud in clouds.items():
        spread = np.std(cloud, axis=0)
        gained = np.sqrt(np.maximum(found.sigma[signal] ** 2 - plain.sigma[signal] ** 2, 0.0))
        assert np.sqrt(np.mean(gained**2) / np.mean(spread**2)) == pytest.approx(1, abs=0.03), signal
        assert np.abs(gained - spread).max() < 0.15 * spread.max(), signal


@both
def test_certainty_changes_nothing(how):
    o = observer()
    plain = columns(getattr(o, how)(DRIVE))
    exactly = Uncertainty(names=NAMES, covariance=np.zeros((4, 4)))
    nothing = Uncertainty(names=(), covariance=np.zeros((0, 0)))
    for u in (exactly, nothing):
        found = columns(getattr(o, how)(DRIVE, u))
        for name in plain:
            np.testing.assert_array_equal(found[name], plain[name])


@both
@each
def test_states_and_holes_are_as_without(name, how):
    record, o = SCENARIOS[name], observer()
    plain, found = (getattr(o, how)(record, u) for u in (None, TYRES_AND_ZERO))
    np.testing.assert_array_equal(found.status, plain.status)
    good = np.isin(found.status, [Status.OK, Status.COASTING])
    for signal in plain.values:
        np.testing.assert_array_equal(found.values[signal], plain.values[signal])
        assert np.isfinite(found.sigma[signal][good]).all(), signal
        assert np.isnan(found.sigma[signal][~good]).all(), signal
        assert (found.sigma[signal][good] >= plain.sigma[signal][good]).all(), signal
    for signal in plain.innovation:
        np.testing.assert_array_equal(found.innovation_sigma[signal], plain.innovation_sigma[signal])


ODD = {
    "ten times the stiffness": one(TYRES[0], 10 * OWN[TYRES[0]]),
    "a roll stiffness of anything": one("semitrailer.roll_stiffness", 1e12),
    "a steer zero of a right angle": one(ZERO, 1.6),
    "a gain of anything": one(f"{STEER}.gain", 5.0),
    "one unknown twice": Uncertainty(names=TYRES[:2], covariance=np.outer(SIGMA[:2], SIGMA[:2])),
    "next to nothing": one(TYRES[0], 1e-9),
    "a length of nothing": one("semitrailer.payload.floor_height", 0.3),
    "everything": Uncertainty(names=tuple(OWN), covariance=np.diag([(0.3 * v) ** 2 + 1e-6 for v in OWN.values()])),
}


@both
@pytest.mark.parametrize("odd", ODD)
def test_odd_numbers_do_no_harm(odd, how):
    record, o = SCENARIOS["slow and missing"], observer()
    plain, found = (getattr(o, how)(record, u) for u in (None, ODD[odd]))
    good = np.isin(found.status, [Status.OK, Status.COASTING])
    for signal in plain.values:
        np.testing.assert_array_equal(found.values[signal], plain.values[signal])
        assert np.isfinite(found.sigma[signal][good]).all(), signal
        assert (found.sigma[signal][good] >= plain.sigma[signal][good]).all(), signal


def test_twice_the_sigma_is_four_times_the_variance():
    """Of a quantity that the answer is linear in; a longer column is gone along in part where it must be."""
    o = observer(gate=1e6)
    plain = squares(o.batch(DRIVE))
    for name, sigma, accuracy in (
        (ZERO, 0.001, 1e-9),
        (TYRES[2], 0.01 * OWN[TYRES[2]], 1e-3),
        (TYRES[2], OWN[TYRES[2]], 1e-6),
    ):
        little, much = (squares(o.batch(DRIVE, one(name, s))) for s in (sigma, 2 * sigma))
        for signal, own in plain.items():
            gained = little[signal] - own
            np.testing.assert_allclose(much[signal] - own, 4 * gained, rtol=accuracy, atol=accuracy * gained.max())


def test_told_elsewhere_the_place_stays(drive):
    """With the CoG uncertain, sideslip under the CoG is told elsewhere; at a place that is given it is told there."""
    u = one("semitrailer.cog", 0.3)
    here, there = (
        Observer(TRUCK, drive.signals, ObserverSettings(places=places, gate=1e6))
        for places in ({}, {"sideslip.semitrailer": TRUCK.unit("semitrailer").cog})
    )
    np.testing.assert_array_equal(
        here.batch(drive).sigma["sideslip.semitrailer"], there.batch(drive).sigma["sideslip.semitrailer"]
    )
    one_sigma, other = (o.batch(drive, u).sigma["sideslip.semitrailer"] for o in (here, there))
    assert np.abs(one_sigma - other).max() > 1e-4


def test_errors_of_sensors_that_are_not_read_do_not_matter():
    u = Uncertainty(
        names=(*NAMES, f"{ROLLS[1]}.offset", "steer.semitrailer.rear.gain", "articulation.semitrailer.offset"),
        covariance=np.diag([*SIGMA**2, 1.0, 1.0, 1.0]),
    )
    record = simulate(TRUCK, count=1, roll=False)
    o = Observer(TRUCK, {"speed", STEER, *YAWS})
    for name, sigma in o.batch(record, TYRES_AND_ZERO).sigma.items():
        np.testing.assert_array_equal(o.batch(record, u).sigma[name], sigma)


def test_what_one_log_has_for_itself():
    """A zero "<name>@<log>" counts in that log only."""
    u = Uncertainty(
        names=(TYRES[0], f"{ZERO}@{DRIVE.name}", f"{ZERO}@other"), covariance=np.diag([SIGMA[0] ** 2, 1e-8, 1.0])
    )
    here = Uncertainty(names=(TYRES[0], ZERO), covariance=np.diag([SIGMA[0] ** 2, 1e-8]))
    assert u.of_log("other").names == (TYRES[0], ZERO)
    assert u.of_log("third").names == (TYRES[0],)
    for name, sigma in observer().batch(DRIVE, here).sigma.items():
        np.testing.assert_array_equal(observer().batch(DRIVE, u).sigma[name], sigma)


def test_the_stream_is_left_alone():
    o = observer()
    before, whole = o.save(), batched(o, DRIVE)
    o.batch(DRIVE, TYRES_AND_ZERO)
    assert o.save() == before
    np.testing.assert_array_equal(batched(o, DRIVE)[YAWS[0]], whole[YAWS[0]])


def test_there_and_back_through_json():
    told = json.loads(json.dumps(TYRES_AND_ZERO.as_dict()))
    again = Uncertainty.from_dict(told)
    assert again.names == NAMES
    np.testing.assert_array_equal(again.covariance, TYRES_AND_ZERO.covariance)
    assert Uncertainty.from_dict({"names": [], "covariance": []}).covariance.shape == (0, 0)


def test_columns_make_the_covariance():
    random = np.random.default_rng(0)
    root = random.normal(size=(6, 6)) * 10.0 ** np.arange(6)[:, None]
    u = Uncertainty(names=tuple("abcdef"), covariance=root @ root.T)
    np.testing.assert_allclose(u.columns() @ u.columns().T, u.covariance, rtol=1e-4, atol=0)
    assert Uncertainty(names=("a", "b"), covariance=np.ones((2, 2))).columns().shape == (2, 1)


@pytest.mark.parametrize(
    ("told", "message"),
    [
        ({"names": ["a", "a"], "covariance": [[1, 0], [0, 1]]}, "a comes twice"),
        ({"names": ["a"], "covariance": [[1, 0], [0, 1]]}, "1 by 1"),
        ({"names": ["a", "b"], "covariance": [[1, 0.5], [0, 1]]}, "symmetric"),
        ({"names": ["a", "b"], "covariance": [[1, 2], [2, 1]]}, "beyond 1"),
        ({"names": ["a"], "covariance": [[-1]]}, "not a covariance"),
        ({"names": ["a", "b"], "covariance": [[0, 1], [1, 1]]}, "beyond 1"),
        ({"names": list("abc"), "covariance": [[1, -0.9, -0.9], [-0.9, 1, -0.9], [-0.9, -0.9, 1]]}, "negative"),
        ({"names": ["a", "b"], "covariance": [[1, None], [None, 1]]}, "not finite"),
        ({"names": ["a", "b"], "covariance": [[1], [0, 1]]}, "rows of numbers"),
        ({"names": ["a"]}, "names and a covariance"),
        ([1, 2], "names and a covariance"),
    ],
)  # fmt: skip
def test_what_is_no_covariance_is_refused(told, message):
    with pytest.raises(SignalError, match=message):
        Uncertainty.from_dict(told)


@pytest.mark.parametrize(
    "name", ["tractor.front.cornering_stifness", "yaw_rate.dolly.offset", "yaw_rate.tractor.delay"]
)
def test_what_no_truck_has_is_refused(name):
    with pytest.raises(SignalError, match=f"{name}: uncertain, but"):
        observer().batch(DRIVE, one(name, 1.0))
