"""push against batch, bit for bit, and the status for damaged records."""

import json
import threading

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fifthwheel.base.errors import SignalError
from fifthwheel.data.record import Record
from fifthwheel.estimate.observe import Observer, ObserverSettings, Status, Uncertainty
from fifthwheel.model import dynamics
from fifthwheel.model.simulate import simulate
from fifthwheel.truck import get
from tests.estimate.observe.conftest import (
    EXACT,
    ROLLS,
    STEER,
    YAWS,
    assert_same,
    batched,
    but_settling,
    pushed,
    put,
    rows,
    samples,
)

TRUCK = get("cheng_cebon_2011")
FINE = simulate(TRUCK, count=2, rate=1000, seed=3)
LANE_CHANGES = simulate(TRUCK, count=2, seed=7)


def irregular() -> Record:
    """5 to 15 Hz, irregular, with intervals of up to 0.2 s."""
    gaps = np.random.default_rng(0).integers(67, 200, size=200)
    gaps[::10] = 200
    indices = np.cumsum(gaps)
    return rows(FINE, indices[indices < len(FINE)])


def with_gaps() -> Record:
    """A third of the values of each measured channel is missing."""
    random = np.random.default_rng(1)
    signals = {
        n: np.where(random.random(len(LANE_CHANGES)) < 1 / 3, np.nan, LANE_CHANGES.signals[n]) for n in (*YAWS, *ROLLS)
    }
    return LANE_CHANGES.with_signals(signals)


def spiked() -> Record:
    """Single spikes in all measured channels."""
    record = LANE_CHANGES
    for k, (name, size) in enumerate({YAWS[0]: 0.6, YAWS[1]: -0.5, ROLLS[0]: 1.5, ROLLS[1]: -1.0}.items()):
        values = record.signals[name].copy()
        values[[300 + k, 900 + 7 * k, 1400]] += size
        record = record.with_signals({name: values})
    return record


def slowing() -> Record:
    """The speed is zero for two seconds between the lane changes; the other signals are those of the moving vehicle."""
    speed = np.interp(LANE_CHANGES.time, [4, 5.5, 7.5, 9], [1, 0, 0, 1]) * LANE_CHANGES.signals["speed"]
    return LANE_CHANGES.with_signals({"speed": speed})


def coasting() -> Record:
    """No measurements from 5 to 8 s."""
    record = LANE_CHANGES
    for name in (*YAWS, *ROLLS):
        record = put(record, name, 5, 8, np.nan)
    return record


SCENARIOS: dict[str, Record] = {
    "regular": LANE_CHANGES,
    "irregular": irregular(),
    "with gaps": with_gaps(),
    "spiked": spiked(),
    "stop": slowing(),
    "steer missing for 0.3 s": put(LANE_CHANGES, STEER, 3, 3.3, np.nan),
    "steer missing for 2 s": put(LANE_CHANGES, STEER, 3, 5, np.nan),
    "steer missing at the start": put(LANE_CHANGES, STEER, 0, 0.2, np.nan),
    "gap in time": rows(LANE_CHANGES, (LANE_CHANGES.time < 4) | (LANE_CHANGES.time > 7)),
    "short gap in time": rows(LANE_CHANGES, (LANE_CHANGES.time < 4) | (LANE_CHANGES.time > 4.9)),
    "coasting": coasting(),
    "slow and missing": put(put(slowing(), STEER, 7, 9.5, np.nan), "speed", 5.5, 6.5, np.nan),
    "always slow": put(LANE_CHANGES, "speed", 0, 99, 3.0),
    "no speed": put(LANE_CHANGES, "speed", 0, 99, np.nan),
    "no measurements": LANE_CHANGES.with_signals(
        {name: np.full(len(LANE_CHANGES), np.nan) for name in (*YAWS, *ROLLS)}
    ),
    "wrong yaw rates": put(put(LANE_CHANGES, YAWS[0], 8, 9, 0.8), YAWS[1], 8, 9, 0.8),
    "two samples": rows(LANE_CHANGES, np.array([100, 107])),
}
each = pytest.mark.parametrize("name", SCENARIOS)


def observer(**changes) -> Observer:
    return Observer(TRUCK, LANE_CHANGES.signals, ObserverSettings(**{**EXACT, **changes}))


@each
def test_push_equals_batch_and_states_are_finite_if_ok_or_coasting_and_nan_otherwise(name):
    record, o = SCENARIOS[name], observer()
    actual = batched(o, record)
    assert_same(pushed(o, record, omit_missing=name == "slow and missing"), actual)
    valid = np.isin(actual["status"], [Status.OK, Status.COASTING, Status.SETTLING])
    for column in actual.keys() - {"time", "status"}:
        assert np.isfinite(actual[column][valid]).all(), column
        assert np.isnan(actual[column][~valid]).all(), column
        if column.endswith(".sigma"):
            assert (actual[column][valid] > 0).all(), column


def test_only_samples_change_the_stream():
    o, other = observer(), observer()
    uncertain = Uncertainty(names=(f"{STEER}.offset",), covariance=np.array([[1e-6]]))
    for k, sample in enumerate(samples(LANE_CHANGES.cut(0, 3))):
        answer = o.push(sample)
        if k == 200:
            o.batch(SCENARIOS["slow and missing"])
            o.batch(LANE_CHANGES, uncertain)
            o.smooth(LANE_CHANGES)
        assert answer == other.push(sample)


@pytest.mark.parametrize(
    ("name", "fraction"),
    [("slow and missing", 0.6), ("coasting", 0.34), ("wrong yaw rates", 0.52), ("no speed", 0.9)],
)
def test_resumed_observer_continues_bit_for_bit(name, fraction):
    record, o = SCENARIOS[name], observer()
    batch_result = batched(o, record)
    all_samples = list(samples(record))
    cut = int(fraction * len(all_samples))
    for sample in all_samples[:cut]:
        o.push(sample)
    saved = json.dumps(o.save(), allow_nan=False)
    fresh = observer()
    fresh.push({"time": -5.0, "speed": 20.0, STEER: 0.1, YAWS[0]: 0.3})  # the previous state has no effect
    fresh.resume(json.loads(saved))
    answers = [fresh.push(sample) for sample in all_samples[cut:]]
    rest = {key: np.array([answer[key] for answer in answers]) for key in answers[0]}
    assert_same(rest, {key: values[cut:] for key, values in batch_result.items()})
    assert json.dumps(o.save(), allow_nan=False) == saved


@pytest.mark.slow
@settings(max_examples=8, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), missing=st.floats(0, 0.9), slow=st.booleans(), cut=st.floats(0, 1))
def test_push_equals_batch_for_any_damaged_record(seed, missing, slow, cut):
    random = np.random.default_rng(seed)
    indices = np.cumsum(random.choice([3, 10, 50, 150, 700, 1500], size=120, p=[0.2, 0.4, 0.2, 0.1, 0.05, 0.05]))
    record = rows(FINE, indices[indices < len(FINE)])
    signals = {
        n: np.where(random.random(len(record)) < missing * random.random(), np.nan, v)
        for n, v in record.signals.items()
    }
    if slow:
        signals["speed"] *= 0.6 + 0.6 * np.sin(record.time + random.random())
    record = record.with_signals(signals)
    o = observer()
    batch_result = batched(o, record)
    all_samples = list(samples(record))
    half = int(cut * len(all_samples))
    answers = [o.push(sample) for sample in all_samples[:half]]
    resumed = observer()
    resumed.resume(json.loads(json.dumps(o.save(), allow_nan=False)))
    answers += [resumed.push(sample) for sample in all_samples[half:]]
    assert_same({key: np.array([a[key] for a in answers]) for key in batch_result}, batch_result)


def statuses(record: Record, **changes) -> np.ndarray:
    return observer(**changes).batch(record).status


def test_intact_records_are_ok():
    for name in ("regular", "irregular", "with gaps", "spiked", "short gap in time", "two samples"):
        assert (but_settling(statuses(SCENARIOS[name])) == Status.OK).all(), name


@pytest.mark.parametrize(
    ("name", "start", "stop", "expected"),
    [
        ("stop", 5.2, 7.8, Status.TOO_SLOW),
        ("steer missing for 2 s", 3.495, 5.0, Status.INPUT_MISSING),
        ("steer missing at the start", -1.0, 0.2, Status.INPUT_MISSING),
        ("gap in time", 4.0, 7.0, Status.OK),
    ],
)
def test_a_new_start_where_the_inputs_are_usable_again(name, start, stop, expected):
    """The states are those of a record that begins there."""
    record, o = SCENARIOS[name], observer(speed_smoothing=np.inf)  # the derivative of the speed is known
    actual = batched(o, record)
    unusable = (record.time > start + 1e-9) & (record.time < stop - 1e-9)
    if expected is Status.TOO_SLOW:
        unusable = record.signals["speed"] < 5.0
        assert 250 < unusable.sum() < 350
    np.testing.assert_array_equal(but_settling(actual["status"]), np.where(unusable, expected, Status.OK))
    restart = record.time[np.flatnonzero(unusable)[-1] + 1] if unusable.any() else stop
    fresh = batched(o, record.cut(restart))
    assert_same(fresh, {k: v[record.time >= restart] for k, v in actual.items()})


def test_settings_of_the_status():
    """The lowest speed, the longest hold of an input, the longest gap and how long a state may coast."""
    stop, missing, gap = (SCENARIOS[n] for n in ("stop", "steer missing for 2 s", "gap in time"))
    assert (statuses(stop, min_speed=1.0) == Status.TOO_SLOW).sum() == (stop.signals["speed"] < 1.0).sum()
    assert Status.INPUT_MISSING not in statuses(missing, hold=3.0)
    assert (statuses(missing, hold=0.0) == Status.INPUT_MISSING).sum() == np.isnan(missing.signals[STEER]).sum()
    first = np.searchsorted(gap.time, 5.0)
    bridged, fresh = (observer(max_gap=limit).batch(gap).values["roll.semitrailer"][first] for limit in (5.0, 1.0))
    assert bridged != fresh
    assert (but_settling(statuses(SCENARIOS["coasting"], coast=5.0)) == Status.OK).all()
    for name, status in (("no speed", Status.INPUT_MISSING), ("always slow", Status.TOO_SLOW)):
        assert (statuses(SCENARIOS[name]) == status).all()
    assert (statuses(SCENARIOS["no measurements"]) == Status.COASTING).mean() == pytest.approx(15 / 16, abs=0.01)


def test_sigma_grows_while_coasting():
    record = SCENARIOS["coasting"]
    actual = observer().batch(record)
    expected = (record.time - record.time[record.time < 5][-1] > 1.0) & (record.time < 8)
    assert expected.sum() == pytest.approx(200, abs=2)
    np.testing.assert_array_equal(but_settling(actual.status), np.where(expected, Status.COASTING, Status.OK))
    for name, sigma in actual.sigma.items():
        assert sigma[799] > 1.04 * sigma[499], name
        assert sigma[-1] == pytest.approx(sigma[499], rel=0.02), name
        if name in record.reference:
            assert np.abs((actual.values[name] - record.reference[name]) / sigma).max() < 4, name


@pytest.mark.parametrize("time", [3.0, -1.0, np.nan, np.inf, None], ids=str)
def test_time_that_does_not_increase_is_refused_without_effect(time):
    """While the steer angle is missing for 0.3 s, and another observer does not get such a sample."""
    record, o, other = SCENARIOS["steer missing for 0.3 s"], observer(), observer()
    given = list(samples(record.cut(0, 3.1)))
    for sample in given:
        assert o.push(sample) == other.push(sample)
    saved = o.save()
    with pytest.raises(SignalError, match=r"^time: "):
        o.push({k: v for k, v in {**given[-1], "time": time}.items() if v is not None})
    assert o.save() == saved
    for sample in samples(record.cut(3.105, 3.6)):
        assert o.push(sample) == other.push(sample)


def test_a_spike_counts_as_missing():
    spikes, o = SCENARIOS["spiked"], observer()
    differs = {n: spikes.signals[n] != LANE_CHANGES.signals[n] for n in (*YAWS, *ROLLS)}
    without_spikes = spikes.with_signals({n: np.where(differs[n], np.nan, spikes.signals[n]) for n in differs})
    with_spikes, without = o.batch(spikes), o.batch(without_spikes)
    for name in differs:
        assert not with_spikes.accepted[name][differs[name]].any()
        assert with_spikes.accepted[name][~differs[name]].mean() > 0.999
    for name in with_spikes.values:
        np.testing.assert_array_equal(with_spikes.values[name], without.values[name])
        np.testing.assert_array_equal(with_spikes.sigma[name], without.sigma[name])
    ungated = observer(gate=1e6).batch(spikes)
    assert all(values.all() for values in ungated.accepted.values())
    assert abs(ungated.values[YAWS[0]] - o.batch(LANE_CHANGES).values[YAWS[0]])[300] > 0.005


def test_reset():
    o, record = observer(), LANE_CHANGES.cut(0, 3)
    once = pushed(o, record)
    o.reset()
    assert_same(pushed(o, record), once)
    o.reset()
    o.push({"time": -100.0, "speed": 20.0, STEER: 0.0})  # before the previous samples


def test_construction_builds_no_model(monkeypatch):
    """Errors of the arguments are found without it; the first sample builds and compiles it."""
    monkeypatch.setattr(dynamics, "model", None)
    o = observer()
    with pytest.raises(TypeError):
        pushed(o, LANE_CHANGES.cut(0, 0.1))
    monkeypatch.undo()
    assert_same(pushed(observer(), LANE_CHANGES.cut(0, 0.1)), batched(o, LANE_CHANGES.cut(0, 0.1)))


def test_state_of_another_observer_is_refused():
    o = observer()
    for sample in samples(LANE_CHANGES.cut(0, 1)):
        o.push(sample)
    saved = json.loads(json.dumps(o.save()))
    for another in (
        Observer(TRUCK.replace({"semitrailer.payload.height": 1.0}), LANE_CHANGES.signals, ObserverSettings(**EXACT)),
        Observer(TRUCK, {"speed", STEER, *YAWS}, ObserverSettings(**EXACT)),
        observer(noise={YAWS[0]: 1e-6}),
        observer(gate=3.0),
        observer(sensor_errors={f"{YAWS[0]}.offset": 0.01}),
        observer(hold=0.1),
        observer(friction=0.8),
    ):
        before = another.save()
        with pytest.raises(SignalError, match="expected one of the same vehicle, signals and settings"):
            another.resume(saved)
        assert another.save() == before


def test_state_of_an_earlier_version_is_refused():
    """Its monitor did not count the samples since a start."""
    o = observer()
    for sample in samples(LANE_CHANGES.cut(0, 1)):
        o.push(sample)
    saved = o.save()
    del saved["made_for"]["carry"]
    with pytest.raises(SignalError, match="expected one of the same vehicle, signals and settings"):
        observer().resume({**saved, "carry": saved["carry"][:-1]})


def test_a_clock_that_was_set_back_is_a_new_start():
    """One time from the future: samples are refused for 1 s, then the observer is that of a new start."""
    observer, fresh = Observer(TRUCK, LANE_CHANGES.signals), Observer(TRUCK, LANE_CHANGES.signals)
    answers, refused = [], 0
    for k, sample in enumerate(samples(LANE_CHANGES)):
        try:
            answers.append(observer.push(sample | ({"time": sample["time"] + 3600.0} if k == 100 else {})))
        except SignalError as error:
            refused, message = refused + 1, str(error)
    assert refused in (100, 101)  # 1 s by rounding
    assert "after 1 s it starts by itself" in message
    assert len(answers) == len(LANE_CHANGES) - refused
    expected = [fresh.push(sample) for sample in [*samples(LANE_CHANGES)][101 + refused :]]
    for answer, new in zip(answers[101:], expected, strict=True):
        assert answer == pytest.approx(new, nan_ok=True)


def test_samples_out_of_order_between_others_stay_refused():
    observer, given = Observer(TRUCK, LANE_CHANGES.signals), [*samples(LANE_CHANGES)]
    for k in range(400, 700):
        observer.push(given[k])
        with pytest.raises(SignalError, match="push samples in the order of time"):
            observer.push(given[k - 300])


def test_an_observer_in_use_refuses_another_thread():
    observer, given = Observer(TRUCK, LANE_CHANGES.signals), [*samples(LANE_CHANGES)]
    observer.push(given[0])
    taken = []

    class Reading(dict[str, float]):
        """A sample during whose reading another thread pushes."""

        def get(self, name, default=None):
            if name == "time":
                thread = threading.Thread(target=push)
                thread.start()
                thread.join()
            return super().get(name, default)

    def push() -> None:
        try:
            observer.push(given[2])
        except SignalError as error:
            taken.append(str(error))

    observer.push(Reading(given[1]))
    assert len(taken) == 1
    assert "another thread" in taken[0]
    assert observer.push(given[2])["time"] == given[2]["time"]
