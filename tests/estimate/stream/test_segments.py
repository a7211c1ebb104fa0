"""Segments of a record: the same inputs as sample by sample."""

from dataclasses import replace

import numpy as np

from fifthwheel.data.record import Record
from fifthwheel.estimate.observe import Observer, ObserverSettings
from fifthwheel.estimate.stream import Status, Stream, StreamSettings, held_inputs, stream_segments, without_measurement
from fifthwheel.model.dynamics import SPEED_RATE, simulation
from fifthwheel.model.simulate import simulate
from fifthwheel.truck import get
from tests.estimate.observe.conftest import STEER, YAWS, put
from tests.estimate.stream.test_stream import Rows

TRUCK = get("cheng_cebon_2011")
LANE_CHANGES = simulate(TRUCK, count=2, seed=7)


def settings_of(**settings: float) -> StreamSettings:
    return Observer(TRUCK, ("speed", STEER, YAWS[0]), ObserverSettings(**settings)).stream.settings


def test_both_forms_agree():
    random = np.random.default_rng(0)
    settings = settings_of(max_steer_rate=0.2, max_acceleration=2.0, hold=0.05)
    noisy = {}
    for name, sigma in (("speed", 0.05), (STEER, 0.003)):
        values = LANE_CHANGES.signals[name] + sigma * random.normal(size=len(LANE_CHANGES))
        noisy[name] = np.where(random.random(values.size) < 0.2, np.nan, values)
    record = LANE_CHANGES.with_signals(noisy)
    assert settings.names == (*noisy, SPEED_RATE)
    held, fresh = held_inputs(record, settings)
    stream, rows = Stream(settings, simulation.step_limit(TRUCK, True)), Rows(3)
    for k, time in enumerate(record.time.tolist()):
        status = stream.process_sample(rows, time, [float(values[k]) for values in noisy.values()], [0.1])
        assert (status is Status.OK) == fresh[k]
        if fresh[k]:
            np.testing.assert_array_equal(stream.inputs, held[k])
    assert 0 < fresh.sum() < len(fresh)
    present = {name: np.isfinite(values) for name, values in noisy.items()}
    refused = [(held[:, i] != record.signals[n])[present[n]].any() for i, n in enumerate(noisy)]
    assert all(refused)
    assert 0.01 < held[:, -1].std() < 1.0


def test_coasting_starts_after_its_time():
    time = np.arange(6) * 0.25
    accepted = np.array([[0, 0], [1, 0], [0, 0], [0, 0], [0, 0], [0, 1]])
    assert without_measurement(time, accepted, 0.5).tolist() == [False, False, False, False, True, False]
    assert without_measurement(time, 0 * accepted, 0.5).tolist() == [False] * 3 + [True] * 3  # since the start


def interrupted() -> Record:
    """Lane changes with a slow phase, a missing steer angle, two gaps in time and missing measurements."""
    record = put(put(LANE_CHANGES, "speed", 3.0, 3.5, 2.0), STEER, 6.0, 7.0, np.nan)
    record = put(put(record, YAWS[0], 4.0, 4.2, np.nan), YAWS[0], 5.0, 5.1, 99.0)
    gaps = np.where(record.time > 8, 0.5, 0.0) + np.where(record.time > 9, 2.0, 0.0)
    return replace(record, time=record.time + gaps)


def test_segments_have_the_rows_of_single_samples():
    record, settings = interrupted(), settings_of(max_acceleration=1e4, hold=0.3)
    limit = simulation.step_limit(TRUCK, True)
    status, segments = stream_segments(record, settings, limit)
    stream, rows, found = Stream(settings, limit), Rows(3), []
    for k, time in enumerate(record.time.tolist()):
        speed, steer, yaw = (float(record.signals[name][k]) for name in ("speed", STEER, YAWS[0]))
        found.append(stream.process_sample(rows, time, [speed, steer], [yaw]))
    assert set(found) == {Status.OK, Status.TOO_SLOW, Status.INPUT_MISSING}
    assert status.tolist() == found
    assert [record.time[segment.samples.start] for segment in segments] == rows.starts
    assert len(segments) == 4
    of_segments = np.vstack([segment.rows[:] for segment in segments])
    np.testing.assert_allclose(of_segments, np.array(rows.rows), atol=1e-12)
    for segment in segments:
        samples = np.arange(len(status))[segment.samples]
        assert (status[samples] == Status.OK).all()
        assert segment.sample_indices[0] == 0
        first = {name: record.signals[name][samples[0]] for name in ("speed", STEER)}
        assert segment.first == first | {SPEED_RATE: segment.rows[:][0, 3]}
        elapsed = np.cumsum(segment.rows[:][:, 0])[segment.sample_indices]
        np.testing.assert_allclose(elapsed, record.time[samples] - record.time[samples[0]], atol=1e-9)
    assert len(of_segments) > (status == Status.OK).sum(), "a gap is divided into steps"


def test_a_part_of_a_segment_begins_at_a_sample():
    """As a segment of its own: no step leads to its first row."""
    record, settings = interrupted(), settings_of(max_acceleration=1e4, hold=0.3)
    segment = stream_segments(record, settings, simulation.step_limit(TRUCK, True))[1][2]
    assert len(segment.rows) > len(segment.sample_indices)
    first, last = (int(segment.sample_indices[k]) for k in (70, -5))
    part = segment.part(first, last)
    samples = np.arange(len(record))
    assert samples[part.samples].tolist() == samples[segment.samples][70:-5].tolist()
    assert (
        part.rows[:][part.sample_indices].tolist()
        == [
            [0.0, *row[4:7], *row[4:]] if k == 70 else row
            for k, row in enumerate(segment.rows[:][segment.sample_indices].tolist())
        ][70:-5]
    )
    assert part.first == segment.inputs(first)
    assert [part.first[n] for n in ("speed", STEER)] == [
        record.signals[n][samples[part.samples][0]] for n in ("speed", STEER)
    ]
    assert segment.rows[:][first, 0] > 0, "the segment has not changed"
