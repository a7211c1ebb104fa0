import copy
import pickle

import numpy as np
import pytest

from fifthwheel.base.errors import SignalError
from fifthwheel.data.record import Record
from fifthwheel.data.record.record import segments_above

T = np.arange(0, 20, 0.1)


def record(**signals):
    return Record(time=T, signals={"speed": np.full(T.size, 20.0), "yaw_rate.tractor": np.sin(T)} | signals)


def with_gap(start, stop):
    return record(speed=np.where((start < T) & (stop > T), np.nan, T))


def test_is_frozen_and_read_only():
    source = np.sin(T)
    made = Record(time=T, signals={"roll.semitrailer": source})
    source[:] = 0
    assert made.signals["roll.semitrailer"][10] == np.sin(T[10])
    with pytest.raises(AttributeError):
        made.time = T
    with pytest.raises(TypeError):
        made.signals["speed"] = T
    with pytest.raises(ValueError, match="read-only"):
        made.signals["roll.semitrailer"][0] = 1.0


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"time": np.where(np.arange(T.size) == 50, 4.85, T)}, r"time: goes back from 4\.9 to 4\.85 s at row 51"),
        ({"time": np.where(np.arange(T.size) == 50, 4.9, T)}, r"time: 4\.9 s at row 51 occurs twice"),
        ({"time": np.where(np.arange(T.size) == 50, np.nan, T)}, r"time: no finite value at row 51"),
        ({"time": T[:1], "signals": {"speed": T[:1]}}, "time: 1 samples, at least 2"),
        ({"time": np.ones((2, 2))}, "time: 2 dimensions"),
        ({"signals": {"speed": T[:-1]}}, "speed: 199 samples, 200 expected"),
        ({"signals": {"speed": np.where(T == 0, np.inf, T)}}, r"speed: infinite at 0\.00 s"),
        ({"signals": {"speed": ["fast"] * T.size}}, "speed: not numbers"),
        ({"signals": {"yaw_rte.tractor": T}}, r"did you mean 'yaw_rate\.tractor'"),
        ({"signals": {"yaw_rate": T}}, r"yaw_rate: .*such as 'yaw_rate\.tractor'"),
        ({"signals": {"speed.tractor": T}}, "call it 'speed'"),
        ({"reference": {"Winkel des Aufliegers": T}}, r"expected quantity\.unit"),
        ({"signals": {"time": T}}, "time: the time base cannot be a signal"),
    ],
)
def test_an_invalid_record_is_refused(change, message):
    with pytest.raises(SignalError, match=message):
        Record(**({"time": T, "signals": {"speed": T}} | change))


def test_a_cut_keeps_both_ends_and_refuses_an_empty_result():
    cut = record().cut(5.0, 7.0)
    assert cut.span == pytest.approx((5.0, 7.0), abs=1e-9)
    assert record().rate == pytest.approx(10.0)
    with pytest.raises(SignalError, match=r"within 0\.00 to 19\.90 s"):
        record().cut(30, 40)


def test_parts_share_memory_unless_they_would_keep_much_of_it():
    time, values = np.arange(1000) * 0.01, np.ones(1000)
    record = Record(time=time, signals={"speed": values})
    assert not np.shares_memory(record.signals["speed"], values), "the caller may change its array"
    changed, most, little = record.with_signals({"grade": values}), record.cut(1.0, 8.0), record.cut(1.0, 2.0)
    for other, shared in ((changed, True), (most, True), (most.cut(2.0, 7.0), True), (little, False)):
        assert np.shares_memory(other.time, record.time) == shared
        assert np.shares_memory(other.signals["speed"], record.signals["speed"]) == shared
        assert not other.signals["speed"].flags.writeable
    view = np.broadcast_to(values, (2, 1000))[0]  # read-only, of an array that is not
    assert not np.shares_memory(Record(time=time, signals={"speed": view}).signals["speed"], values)


def test_short_gaps_of_an_input_are_interpolated():
    assert with_gap(4.05, 4.45).input("speed") == pytest.approx(T, abs=1e-12)
    assert with_gap(-1, 0.25).input("speed")[0] == pytest.approx(0.3)


@pytest.mark.parametrize(
    ("start", "stop", "where"),
    [
        (4.05, 6.0, "4.00 to 6.00"),
        (-1, 0.95, "0.00 to 1.00"),
        (18.95, 99, "18.90 to 19.90"),
    ],
)
def test_long_gaps_of_an_input_are_refused(start, stop, where):
    with pytest.raises(SignalError, match="speed: missing in all samples of"):
        with_gap(-1, 99).input("speed", np.inf)
    with pytest.raises(SignalError, match=rf"speed: missing from {where} s; up to 0\.5 s"):
        with_gap(start, stop).input("speed")


@pytest.mark.parametrize(
    ("start", "stop", "spans"),
    [
        (4.05, 4.45, [(0, 19.9)]),
        (4.05, 4.55, [(0, 4.0), (4.6, 19.9)]),
        (-1, 0.45, [(0, 19.9)]),
        (-1, 0.55, [(0.6, 19.9)]),
        (19.45, 99, [(0, 19.9)]),
        (19.35, 99, [(0, 19.3)]),
    ],
)
def test_a_long_gap_of_an_input_ends_a_segment(start, stop, spans):
    names = ("speed", "yaw_rate.tractor")
    for name in names:
        gap = record(**{name: np.where((start < T) & (stop > T), np.nan, record().signals[name])})
        segments = segments_above(gap, 5.0, names)
        assert [segment.span for segment in segments] == [pytest.approx(span) for span in spans]
        assert all(segment.input(name).size for segment in segments), "no gap is too long"
        assert segments_above(gap, 5.0, [n for n in names if n != name])[0].span == gap.span
    gap = record(speed=np.where((T > 7.05) & (T < 9), np.nan, 20.0), **{names[1]: np.where(T < 8, np.nan, T)})
    assert [segment.span for segment in segments_above(gap, 5.0, names)] == [(pytest.approx(9.0), pytest.approx(19.9))]


def test_an_input_with_a_sample_a_second_is_named():
    steer = np.where(np.arange(T.size) % 10, np.nan, 0.0)
    with pytest.raises(SignalError, match=r"steer\.tractor\.front: missing for more than 0\.5 s again and again"):
        segments_above(record(**{"steer.tractor.front": steer}), 5.0, ("speed", "steer.tractor.front"))


def test_a_pause_of_all_signals_is_no_gap_of_an_input():
    """Messages of a trace have timestamps of their own, so that the last row before a pause may lack the speed."""
    time = np.concatenate([np.arange(0, 2, 0.01), np.arange(7, 9, 0.01)])
    speed = np.full(400, 20.0)
    speed[[199, 201]] = np.nan
    record = Record(time=time, signals={"speed": speed, "yaw_rate.tractor": np.zeros(400)}, name="trace")
    np.testing.assert_array_equal(record.input("speed"), 20.0)
    assert [segment.span for segment in record.segments()] == [(0, 1.99), (7, pytest.approx(8.99))]
    missing = np.where((time > 1) & (time < 1.8), np.nan, speed)
    with pytest.raises(SignalError, match=r"speed: missing from 1\.00 to 1\.80 s"):
        record.with_signals({"speed": missing}).input("speed")


def test_an_absent_input_is_refused_with_similar_names():
    with pytest.raises(SignalError, match=r"did you mean 'yaw_rate\.tractor'"):
        record().input("yaw_rate.traktor")


def test_segments_are_separated_by_time_gaps():
    time = np.concatenate([T[:50], T[50:55] + 5, T[60:] + 10])
    segments = Record(time=time, signals={"speed": time}, name="x").segments()
    assert [segment.name for segment in segments] == ["x (1)", "x (2)"]
    assert [len(segment) for segment in segments] == [50, 140]
    without_gap = record()
    assert without_gap.segments() == [without_gap]
    with pytest.raises(SignalError, match="check the unit of time"):
        Record(time=T * 1000, signals={"speed": T}).segments()


def test_with_signals_adds_and_replaces():
    changed = record().with_signals({"speed": 2 * T, "roll.tractor": T})
    assert list(changed.signals) == ["speed", "yaw_rate.tractor", "roll.tractor"]
    assert changed.signals["speed"][10] == pytest.approx(2.0)


def test_equality_copies_and_pickles():
    made = record(speed=np.where(T < 1, np.nan, T))
    assert made == pickle.loads(pickle.dumps(made)) == copy.deepcopy(made)
    assert made != record()
    assert made != "record"
    assert "200 samples, 0 to 19.9 s at 10 Hz: speed" in repr(made)
