"""`Record.averaged`: means of samples, also where a signal lacks some of them."""

import numpy as np
import pytest

from fifthwheel.data.record import Record

TIME = np.arange(400) / 100
RISING = 20 + 0.5 * TIME


def test_means_of_samples() -> None:
    rng = np.random.default_rng(0)
    record = Record(time=TIME, signals={"speed": RISING, "yaw_rate.tractor": rng.normal(size=400)}, name="run")
    rows = record.averaged(4)
    assert len(rows) == 100
    assert rows.time[:2] == pytest.approx([0.015, 0.055])
    assert rows.signals["speed"] == pytest.approx(20 + 0.5 * rows.time)
    expected = record.signals["yaw_rate.tractor"].reshape(100, 4).mean(axis=1)
    assert rows.signals["yaw_rate.tractor"] == pytest.approx(expected)
    assert rows.name == "run"
    short = record.cut(0.0, 0.06)
    assert short.averaged(4) is short, "too short for means"
    assert record.averaged(1) is record


@pytest.mark.parametrize(("every", "first"), [(2, 0), (4, 3), (10, 1)])
def test_a_slower_signal_is_moved_to_the_time_of_the_row(every: int, first: int) -> None:
    speed = np.where(np.arange(400) % every == first % every, RISING, np.nan)
    rows = Record(time=TIME, signals={"speed": speed}).averaged(4)
    present = np.isfinite(rows.signals["speed"])
    assert present.sum() >= 400 // max(every, 4) - 1
    assert rows.signals["speed"][present] == pytest.approx(20 + 0.5 * rows.time[present])


def test_a_pause_is_kept() -> None:
    time = np.concatenate([TIME[:50], TIME[50:] + 2.0])
    rows = Record(time=time, signals={"speed": 20 + 0.5 * time}).averaged(4)
    assert np.diff(rows.time).max() > 2.0
    assert rows.signals["speed"] == pytest.approx(20 + 0.5 * rows.time)
    assert (np.abs(rows.time[:, None] - time).min(axis=1) < 0.01).all(), "no row lies in the pause"
