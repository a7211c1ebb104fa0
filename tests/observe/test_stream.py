"""push against batch, bit for bit, and what both make of spoilt records."""

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fifthwheel.errors import SignalError
from fifthwheel.logs import Record
from fifthwheel.observe import Observer, ObserverSettings, Status
from fifthwheel.simulate import simulate
from fifthwheel.vehicle import get

from .conftest import ROLLS, STEER, YAWS, assert_same, batched, pushed, put, rows, samples

TRUCK = get("cheng_cebon_2011")
FINE = simulate(TRUCK, count=2, rate=1000, seed=3)
DRIVE = simulate(TRUCK, count=2, seed=7)


def irregular() -> Record:
    """5 to 15 Hz, every gap another one, none above 0.2 s."""
    gaps = np.random.default_rng(0).integers(67, 200, size=200)
    gaps[::10] = 200
    places = np.cumsum(gaps)
    return rows(FINE, places[places < len(FINE)])


def thinned() -> Record:
    """A third of every measurement missing, each channel its own."""
    random = np.random.default_rng(1)
    lost = {n: np.where(random.random(len(DRIVE)) < 1 / 3, np.nan, DRIVE.signals[n]) for n in (*YAWS, *ROLLS)}
    return DRIVE.with_signals(lost)


def spiked() -> Record:
    record = DRIVE
    for k, (name, size) in enumerate({YAWS[0]: 0.6, YAWS[1]: -0.5, ROLLS[0]: 1.5, ROLLS[1]: -1.0}.items()):
        values = record.signals[name].copy()
        values[[300 + k, 900 + 7 * k, 1400]] += size
        record = record.with_signals({name: values})
    return record


def slowing() -> Record:
    """Down to a stop for two seconds and up again; the signals of a moving truck all the while."""
    speed = np.interp(DRIVE.time, [4, 6, 8, 10], [1, 0, 0, 1]) * DRIVE.signals["speed"]
    return DRIVE.with_signals({"speed": speed})


def coasting() -> Record:
    record = DRIVE
    for name in (*YAWS, *ROLLS):
        record = put(record, name, 5, 8, np.nan)
    return record


SCENARIOS: dict[str, Record] = {
    "regular": DRIVE,
    "irregular": irregular(),
    "thinned": thinned(),
    "spiked": spiked(),
    "stop": slowing(),
    "steer missing for 0.3 s": put(DRIVE, STEER, 3, 3.3, np.nan),
    "steer missing for 2 s": put(DRIVE, STEER, 3, 5, np.nan),
    "steer missing at first": put(DRIVE, STEER, 0, 0.2, np.nan),
    "speed missing for 2 s": put(DRIVE, "speed", 9, 11, np.nan),
    "gap in time": rows(DRIVE, (DRIVE.time < 4) | (DRIVE.time > 7)),
    "gap that is bridged": rows(DRIVE, (DRIVE.time < 4) | (DRIVE.time > 4.9)),
    "coasting": coasting(),
    "slow and missing": put(put(slowing(), STEER, 7, 9.5, np.nan), "speed", 5.5, 6.5, np.nan),
    "never fast": put(DRIVE, "speed", 0, 99, 3.0),
    "no speed at all": put(DRIVE, "speed", 0, 99, np.nan),
    "nothing measured at all": put(
        put(put(put(DRIVE, YAWS[0], 0, 99, np.nan), YAWS[1], 0, 99, np.nan), ROLLS[0], 0, 99, np.nan),
        ROLLS[1],
        0,
        99,
        np.nan,
    ),
    "two samples": rows(DRIVE, np.array([100, 107])),
}
each = pytest.mark.parametrize("name", SCENARIOS)


def observer(**changes) -> Observer:
    return Observer(TRUCK, DRIVE.signals, ObserverSettings(**changes))


@each
def test_push_gives_what_batch_gives(name):
    record, o = SCENARIOS[name], observer()
    whole = batched(o, record)
    assert_same(pushed(o, record), whole)
    o.reset()
    assert_same(pushed(o, record, leave_out=True), whole)


@each
def test_states_are_finite_where_they_may_be_believed_and_nan_elsewhere(name):
    found = batched(observer(), SCENARIOS[name])
    good = np.isin(found["status"], [Status.OK, Status.COASTING])
    for column in found.keys() - {"time", "status"}:
        assert np.isfinite(found[column][good]).all(), column
        assert np.isnan(found[column][~good]).all(), column
        if column.endswith(".sigma"):
            assert (found[column][good] > 0).all(), column


@each
def test_batch_leaves_the_stream_alone(name):
    o, other = observer(), observer()
    for k, sample in enumerate(samples(DRIVE)):
        answer = o.push(sample)
        if k % 400 == 200:
            o.batch(SCENARIOS[name])
        assert answer == other.push(sample)


@each
@pytest.mark.parametrize("part", [0.0, 0.2, 0.44, 0.6, 0.99])
def test_saved_and_resumed_it_goes_on_bit_for_bit(name, part):
    record, o = SCENARIOS[name], observer()
    whole = batched(o, record)
    all_samples = list(samples(record))
    cut = int(part * len(all_samples))
    for sample in all_samples[:cut]:
        o.push(sample)
    saved = json.dumps(o.save(), allow_nan=False)
    fresh = observer()
    fresh.push({"time": -5.0, "speed": 20.0, STEER: 0.1, YAWS[0]: 0.3})  # what was there before does not matter
    fresh.resume(json.loads(saved))
    answers = [fresh.push(sample) for sample in all_samples[cut:]]
    rest = {key: np.array([answer[key] for answer in answers]) for key in answers[0]}
    assert_same(rest, {key: values[cut:] for key, values in whole.items()})
    assert json.dumps(o.save(), allow_nan=False) == saved


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), lost=st.floats(0, 0.9), slow=st.booleans(), cut=st.floats(0, 1))
def test_any_spoilt_record_streams_as_it_batches(seed, lost, slow, cut):
    random = np.random.default_rng(seed)
    places = np.cumsum(random.choice([3, 10, 50, 150, 700, 1500], size=120, p=[0.2, 0.4, 0.2, 0.1, 0.05, 0.05]))
    record = rows(FINE, places[places < len(FINE)])
    spoilt = {
        n: np.where(random.random(len(record)) < lost * random.random(), np.nan, v) for n, v in record.signals.items()
    }
    if slow:
        spoilt["speed"] *= 0.6 + 0.6 * np.sin(record.time + random.random())
    record = record.with_signals(spoilt)
    o = observer()
    whole = batched(o, record)
    all_samples = list(samples(record))
    half = int(cut * len(all_samples))
    answers = [o.push(sample) for sample in all_samples[:half]]
    resumed = observer()
    resumed.resume(json.loads(json.dumps(o.save(), allow_nan=False)))
    answers += [resumed.push(sample) for sample in all_samples[half:]]
    assert_same({key: np.array([a[key] for a in answers]) for key in whole}, whole)


def statuses(record: Record, **changes) -> np.ndarray:
    return observer(**changes).batch(record).status


def after(record: Record, start: float) -> Record:
    return record.cut(start)


def test_a_good_record_is_ok_throughout():
    for name in ("regular", "irregular", "thinned", "spiked", "gap that is bridged", "two samples"):
        assert (statuses(SCENARIOS[name]) == Status.OK).all(), name


def test_irregular_samples_need_steps_between_them():
    o = observer()
    assert np.diff(SCENARIOS["irregular"].time).max() == pytest.approx(0.2)
    speed = int(SCENARIOS["irregular"].signals["speed"][0])
    assert o._short[speed] < np.diff(SCENARIOS["irregular"].time).max()


def test_a_spike_counts_as_missing():
    spikes, o = SCENARIOS["spiked"], observer()
    differs = {n: spikes.signals[n] != DRIVE.signals[n] for n in (*YAWS, *ROLLS)}
    blanked = spikes.with_signals({n: np.where(differs[n], np.nan, spikes.signals[n]) for n in differs})
    with_spikes, without = o.batch(spikes), o.batch(blanked)
    for name in differs:
        assert not with_spikes.accepted[name][differs[name]].any()
        assert with_spikes.accepted[name][~differs[name]].mean() > 0.999
    for name in with_spikes.values:
        np.testing.assert_array_equal(with_spikes.values[name], without.values[name])
        np.testing.assert_array_equal(with_spikes.sigma[name], without.sigma[name])


def test_without_the_gate_a_spike_is_believed():
    moved = observer(gate=1e6).batch(SCENARIOS["spiked"])
    assert all(values.all() for values in moved.accepted.values())
    at = 300
    assert abs(moved.values[YAWS[0]][at] - observer().batch(DRIVE).values[YAWS[0]][at]) > 0.005


def test_too_slow_while_under_the_least_speed_and_then_anew():
    record, o = SCENARIOS["stop"], observer()
    found = o.batch(record)
    slow = record.signals["speed"] < 5.0
    assert 250 < slow.sum() < 350
    np.testing.assert_array_equal(found.status, np.where(slow, Status.TOO_SLOW, Status.OK))
    again = record.time[np.flatnonzero(slow)[-1] + 1]
    fresh = batched(observer(), after(record, again))
    assert_same(fresh, {k: v[record.time >= again] for k, v in batched(o, record).items()})
    assert (statuses(record, min_speed=1.0) == Status.TOO_SLOW).sum() == (record.signals["speed"] < 1.0).sum()


def test_recovery_from_a_stop_is_accurate():
    record = put(DRIVE, "speed", 4, 6, 1.0)  # between the lane changes and in one: only the speed's channel failed
    found = observer().batch(record)
    later = record.time >= 6.5
    for name, truth in record.reference.items():
        error = (found.values[name] - truth)[later]
        assert np.abs(error / found.sigma[name][later]).max() < 4, name


def test_a_missing_steer_angle_is_held_for_a_while():
    record, o = SCENARIOS["steer missing for 0.3 s"], observer()
    at = np.searchsorted(record.time, 3.0)
    held = put(record, STEER, 3, 3.3, record.signals[STEER][at - 1])
    assert (o.batch(record).status == Status.OK).all()
    assert_same(batched(o, record), batched(o, held))


@pytest.mark.parametrize(("name", "start"), [("steer missing for 2 s", 3.0), ("speed missing for 2 s", 9.0)])
def test_an_input_missing_for_long(name, start):
    record, o = SCENARIOS[name], observer()
    status = o.batch(record).status
    last = record.time[record.time < start - 1e-9][-1]
    gone = (record.time - last > 0.5) & (record.time < start + 2)
    assert gone.sum() == pytest.approx(150, abs=2)
    np.testing.assert_array_equal(status, np.where(gone, Status.INPUT_MISSING, Status.OK))
    back = record.time[np.flatnonzero(gone)[-1] + 1]
    fresh = batched(observer(), after(record, back))
    assert_same(fresh, {k: v[record.time >= back] for k, v in batched(o, record).items()})
    assert (statuses(record, hold=3.0) == Status.OK).all()
    assert (statuses(record, hold=0.0) == Status.INPUT_MISSING).sum() == np.isnan(
        record.signals[STEER if "steer" in name else "speed"]
    ).sum()


def test_a_speed_that_no_truck_has_counts_as_missing():
    """However large, it is held over like a missing one, and costs no time: no step is cut into thousands."""
    wrong = put(put(DRIVE, "speed", 4.0, 4.3, 61.0), "speed", 8.0, 10.0, 1e6)
    missing = put(put(DRIVE, "speed", 4.0, 4.3, np.nan), "speed", 8.0, 10.0, np.nan)
    found = batched(observer(), wrong)
    assert_same(found, batched(observer(), missing))
    assert_same(found, pushed(observer(), wrong))
    assert (found["status"][(DRIVE.time >= 8.6) & (DRIVE.time < 10.0)] == Status.INPUT_MISSING).all()
    assert (found["status"][DRIVE.time < 8.4] == Status.OK).all()


def test_an_input_not_seen_yet_is_missing():
    found = observer().batch(SCENARIOS["steer missing at first"])
    early = found.time < 0.2 - 1e-9
    np.testing.assert_array_equal(found.status, np.where(early, Status.INPUT_MISSING, Status.OK))
    assert (statuses(SCENARIOS["no speed at all"]) == Status.INPUT_MISSING).all()
    assert (statuses(SCENARIOS["never fast"]) == Status.TOO_SLOW).all()


def test_after_a_gap_in_time_it_starts_anew():
    record, o = SCENARIOS["gap in time"], observer()
    whole = batched(o, record)
    assert (whole["status"] == Status.OK).all()
    fresh = batched(o, after(record, 5.0))
    assert_same(fresh, {k: v[record.time > 5] for k, v in whole.items()})
    bridged = batched(observer(max_gap=5.0), record)
    first = np.searchsorted(record.time, 5.0)
    assert bridged["roll.semitrailer"][first] != fresh["roll.semitrailer"][0]


def test_without_measurements_it_coasts():
    record, o = SCENARIOS["coasting"], observer()
    found = o.batch(record)
    last = record.time[record.time < 5][-1]
    expected = (record.time - last > 1.0) & (record.time < 8)
    assert expected.sum() == pytest.approx(200, abs=2)
    np.testing.assert_array_equal(found.status, np.where(expected, Status.COASTING, Status.OK))
    for name, sigma in found.sigma.items():
        assert sigma[799] > 1.04 * sigma[499], name  # it knows that it knows less
        assert sigma[-1] == pytest.approx(sigma[499], rel=0.02), name
        if name in record.reference:
            assert np.abs((found.values[name] - record.reference[name]) / sigma).max() < 4, name
    assert (statuses(record, coast=5.0) == Status.OK).all()
    assert (statuses(SCENARIOS["nothing measured at all"]) == Status.COASTING).mean() == pytest.approx(
        15 / 16, abs=0.01
    )


def test_measurements_that_are_all_refused_are_as_good_as_none():
    record = DRIVE
    for name in (*YAWS, *ROLLS):
        record = put(record, name, 5, 8, 40.0)
    found, none = observer().batch(record), observer().batch(SCENARIOS["coasting"])
    np.testing.assert_array_equal(found.status, none.status)
    for name in found.values:
        np.testing.assert_array_equal(found.values[name], none.values[name])


def test_infinite_samples_count_as_missing():
    o, other = observer(), observer()
    for k, sample in enumerate(samples(DRIVE.cut(0, 2))):
        wild = {YAWS[0]: np.inf} if k % 3 else {STEER: -np.inf, ROLLS[1]: np.inf}
        if k:
            answer = o.push(sample | wild)
            assert answer == other.push({n: v for n, v in sample.items() if n not in wild})
        else:
            assert o.push(sample) == other.push(sample)


@pytest.mark.parametrize("time", [3.0, 2.9999, 0.0, -1.0, np.nan, np.inf, -np.inf, None], ids=str)
@pytest.mark.parametrize("at", [3.0, 3.3], ids=["running", "input held"])
def test_time_that_does_not_go_forward_is_refused_and_changes_nothing(time, at):
    record, o = SCENARIOS["steer missing for 0.3 s"], observer()
    before = list(samples(record.cut(0, at)))
    for sample in before:
        o.push(sample)
    saved = o.save()
    if time is not None and np.isfinite(time):
        time = min(time, before[-1]["time"])
    bad = {k: v for k, v in {**before[-1], "time": time}.items() if v is not None}
    with pytest.raises(SignalError, match=r"^time: "):
        o.push(bad)
    assert o.save() == saved
    rest = [o.push(sample) for sample in samples(record.cut(at + 0.005))]
    whole = batched(observer(), record)
    for name in whole:
        np.testing.assert_array_equal([a[name] for a in rest], whole[name][len(before) :])


def test_reset_forgets():
    o = observer()
    once = pushed(o, DRIVE)
    o.reset()
    assert_same(pushed(o, DRIVE), once)
    o.reset()
    o.push({"time": -100.0, "speed": 20.0, STEER: 0.0})  # long before the samples that it forgot


OTHERS = {
    "another truck": lambda: Observer(get("auburn_6x4"), DRIVE.signals),
    "other parameters": lambda: Observer(
        TRUCK.replace({"semitrailer.payload.height": 1.0}), DRIVE.signals, ObserverSettings()
    ),
    "fewer signals": lambda: Observer(TRUCK, set(DRIVE.signals) - {ROLLS[1]}),
    "no roll": lambda: Observer(TRUCK, {"speed", STEER, *YAWS}),
    "another axle steered": lambda: Observer(TRUCK, {"speed", "steer.semitrailer.front", *YAWS, *ROLLS}),
    "other noise": lambda: observer(noise={YAWS[0]: 1e-6}),
    "other process noise": lambda: observer(process_noise=2.0),
    "another gate": lambda: observer(gate=3.0),
    "other zeros": lambda: observer(zeros={f"{YAWS[0]}.offset": 0.01}),
    "another least speed": lambda: observer(min_speed=8.0),
    "another hold": lambda: observer(hold=0.1),
    "another coast": lambda: observer(coast=3.0),
    "another gap": lambda: observer(max_gap=3.0),
}


@pytest.mark.parametrize("other", OTHERS)
def test_resuming_what_another_observer_saved_is_refused(other):
    o = observer()
    for sample in samples(DRIVE.cut(0, 1)):
        o.push(sample)
    stranger = OTHERS[other]()
    before = stranger.save()
    with pytest.raises(SignalError, match="another truck, other signals or settings"):
        stranger.resume(json.loads(json.dumps(o.save())))
    assert stranger.save() == before
