"""Records of arrays and of data frames."""

import numpy as np
import pandas as pd
import pytest

from fifthwheel.base.errors import SignalError
from fifthwheel.data.record import Record
from fifthwheel.model.simulate import simulate
from fifthwheel.truck import get

YAW = "yaw_rate.tractor"
UNITS = {"speed": "km/h", YAW: "deg/s", "reference.yaw_rate.tractor": "deg/s"}
COLUMNS = {"speed": [72.0, np.nan, 36.0], YAW: [0.0, 1.0, 2.0], "reference.yaw_rate.tractor": [0.0, 1.5, 2.0]}


def expected(**fields) -> Record:
    rates = np.radians([COLUMNS[YAW], COLUMNS["reference.yaw_rate.tractor"]])
    return Record(
        time=[0, 0.1, 0.3], signals={"speed": [20, np.nan, 10], YAW: rates[0]}, reference={YAW: rates[1]}, **fields
    )


def close(first: Record, second: Record) -> bool:
    pairs = ((first.signals, second.signals), (first.reference, second.reference))
    same = [a.keys() == b.keys() and all(np.allclose(a[n], b[n], equal_nan=True) for n in a) for a, b in pairs]
    return np.allclose(first.time, second.time) and all(same)


def test_arrays_are_converted():
    record = Record.from_arrays([0, 0.1, 0.3], COLUMNS, units=UNITS, name="run")
    assert close(record, expected())
    assert record.name == "run"
    assert Record.from_arrays([0, 1], {"speed": [3, 4]}) == Record(time=[0, 1], signals={"speed": [3, 4]})


def test_a_record_survives_a_data_frame():
    record = simulate(get("cheng_cebon_2011"), count=1, seed=1)
    assert record.reference
    assert Record.from_pandas(record.to_pandas()) == record


@pytest.mark.parametrize("kind", ["s", "duration", "date", "zone"])
def test_the_index_is_the_time(kind):
    time = np.array([0, 0.1, 0.3])
    index = pd.Index(time) if kind == "s" else pd.to_timedelta(time, unit="s")
    if kind in ("date", "zone"):
        index = pd.Timestamp("2026-05-01 12:00", tz="Europe/Berlin" if kind == "zone" else None) + index
    record = Record.from_pandas(pd.DataFrame(COLUMNS, index=index), units=UNITS)
    assert close(record, expected())
    started = {"date": "2026-05-01T12:00:00+00:00", "zone": "2026-05-01T10:00:00+00:00"}.get(kind)
    assert (record.date and record.date.isoformat()) == started


def test_missing_values_of_pandas_are_nan():
    speed = pd.array([20, None], dtype="Int64")
    record = Record.from_pandas(pd.DataFrame({"speed": speed}, index=[0.0, 0.1]))
    np.testing.assert_array_equal(record.signals["speed"], [20, np.nan])


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Record.from_arrays([0, 1], {"sped": [1, 2]}), "sped"),
        (
            lambda: Record.from_arrays([0, 1], {"speed": [1, 2]}, units={"sped": "m/s"}),
            "sped: has a unit, but is not a",
        ),
        (
            lambda: Record.from_arrays([0, 1], {"speed": [1, 2]}, units={"speed": "deg"}),
            "speed: expected m/s or a unit",
        ),
        (lambda: Record.from_arrays([0, 1], {"speed": [1, 2, 3]}), "speed: 3 samples, 2 expected"),
        (lambda: Record.from_pandas(pd.DataFrame({"speed": [1, 2]})), r"time: .* use frame.set_index\('time'\)"),
        (lambda: Record.from_pandas(pd.DataFrame({"speed": [1, 2]}, index=["a", "b"])), "time: expected an index of"),
        (lambda: Record.from_pandas(pd.DataFrame({"speed": ["x", "y"]}, index=[0.0, 1.0])), "speed: not numbers"),
        (lambda: Record.from_pandas(pd.DataFrame({0: [1, 2]}, index=[0.0, 1.0])), "0: "),
        (
            lambda: Record.from_pandas(pd.DataFrame([[1, 2]] * 2, index=[0.0, 1.0], columns=["speed", "speed"])),
            "speed: two columns have this name",
        ),
    ],
)
def test_errors_name_the_signal_and_the_cure(make, message):
    with pytest.raises(SignalError, match=message):
        make()
