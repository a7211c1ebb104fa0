from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest

from fifthwheel.base.errors import SignalError
from fifthwheel.data.logs import SignalMap, read_log


def read_table(tmp_path, toml, **columns):
    rows = zip(*columns.values(), strict=True)
    (tmp_path / "log.csv").write_text("\n".join([",".join(columns), *(",".join(map(repr, row)) for row in rows), ""]))
    return read_log(tmp_path / "log.csv", SignalMap.parse(toml))


T = (np.arange(100) * 0.1).round(6).tolist()


def test_unit_sign_gain_offset_and_sum(tmp_path):
    toml = """
        time = {column = "ms", unit = "ms"}
        [signals]
        steer.tractor.front = {column = "wheel", unit = "deg", sign = -1, gain = 0.05, offset = "0.1 deg"}
        "yaw_rate.semitrailer" = {sum = ["r", "dr"], offset = 0.5}
        [reference]
        "roll.tractor" = "phi"
    """
    columns = {"ms": [0, 10, 20], "wheel": [20, 40, 60], "r": [1, 2, 3], "dr": [0.5, 0.5, 0.5], "phi": [1, 2, 3]}
    record = read_table(tmp_path, toml, **columns)
    assert record.time == pytest.approx([0, 0.01, 0.02])
    assert record.signals["steer.tractor.front"] == pytest.approx(np.radians([-1.1, -2.1, -3.1]))
    assert record.signals["yaw_rate.semitrailer"] == pytest.approx([1, 2, 3])
    assert record.reference["roll.tractor"] == pytest.approx([1, 2, 3])


INVALID = [
    ("[signals.speed]\ncolum = 'v'", r"signals\.speed\.colum: unknown key; did you mean 'column'"),
    ("[time]\ncolumn = 't'\nunits = 's'\n[signals]\nspeed = 'v'", r"time\.units: unknown key; did you mean 'unit'"),
    ("[signal]\nspeed = 'v'", "signal: unknown key; did you mean 'signals'"),
    ("[signals]\n'yaw_rte.tractor' = 'r'", r"signals: yaw_rte\.tractor: .*did you mean 'yaw_rate\.tractor'"),
    ("[signals.speed]\ncolumn = 'v'\nsum = ['a']", "either column = ... or sum"),
    ("[signals.speed]\nunit = 'm/s'", "either column = ... or sum"),
    ("[signals.speed]\ncolumn = 'v'\nsign = 2", "sign: input should be 1 or -1, got 2"),
    ("[signals.speed]\ncolumn = 'v'\nunit = 'deg'", "speed: expected m/s or"),
    ("[signals.speed]\ncolumn = 'v'\noffset = '1 deg'", "speed: expected m/s or .*got 'deg'"),
    ("[signals.speed]\ncolumn = 'v'\ndelay = '1 m'", "delay: expected s or .*got 'm'"),
    ("[signals.speed]\ncolumn = 'v'\ndelay = -3566", "delay: expected at most 60 s, got -3566 s; .*summer time"),
    ("[signals.speed]\ncolumn = 'v'\ndelay = '1 h +- 1 s'", "delay: expected at most 60 s, got 3600 s"),
    ("[signals.speed]\ncolumn = 'v'\ngain = nan", r"signals\.speed\.gain: input should be a finite number"),
    ("[signals.speed]\ncolumn = 'v'\npoints = [[1, 2], [1, 3]]", "the first numbers of the pairs must increase"),
    ("[signals.speed]\ncolumn = 'v'\npoints = [[1, 2]]", "at least 2 pairs of numbers expected, got 1"),
    ("[signals]\n'yaw_rate.a' = 'r'\n'yaw_rate.b' = 'r'", r"column 'r' is mapped to yaw_rate\.a and to yaw_rate\.b"),
    ("[time]\nrate = 0", "at least 1 Hz expected, got 0 Hz"),
    ("signals = 3", "signals: .*got 3"),
    ("[signals", "not TOML"),
]


def test_an_invalid_map_is_refused_with_the_cure():
    for toml, message in INVALID:
        with pytest.raises(SignalError, match=message):
            SignalMap.parse(toml)


def test_absent_files_and_columns_are_refused(tmp_path):
    with pytest.raises(SignalError, match="cannot be read"):
        SignalMap.load(tmp_path / "none.toml")
    with pytest.raises(SignalError, match="no column 'velocty'; did you mean 'velocity'"):
        read_table(tmp_path, "[signals]\nspeed = 'velocty'", t=[0, 1], velocity=[1, 2])


def test_a_delayed_measurement_keeps_its_samples_at_earlier_instants(tmp_path):
    toml = "[signals]\nspeed = 'v'\n[signals.'yaw_rate.tractor']\ncolumn = 'r'\ndelay = '30 ms'"
    record = read_table(tmp_path, toml, t=T, v=T, r=T)
    assert len(record) == 200
    rate, speed = record.signals["yaw_rate.tractor"], record.signals["speed"]
    taken = np.isfinite(rate)
    assert rate[taken] == pytest.approx(T)
    assert record.time[taken] == pytest.approx(np.array(T) - 0.03)
    assert np.isnan(speed[0])  # before the first row: nothing is extrapolated
    assert speed[1:] == pytest.approx(record.time[1:])


def test_a_delayed_input_is_interpolated_on_the_rows(tmp_path):
    """A delay of an integer number of rows adds no instants between."""
    toml = "[signals]\n'yaw_rate.tractor' = 'r'\n[signals.'steer.tractor.front']\ncolumn = 'd'\ndelay = 0.25"
    record = read_table(tmp_path, toml, t=T, r=T, d=[t / 2 for t in T])
    assert record.time == pytest.approx(T)
    steer = record.signals["steer.tractor.front"]
    assert steer[:97] == pytest.approx((record.time[:97] + 0.25) / 2)
    assert np.isnan(steer[97:]).all()
    toml = "[signals]\nspeed = 'v'\n[signals.'yaw_rate.tractor']\ncolumn = 'r'\ndelay = 0.2"
    record = read_table(tmp_path, toml, t=T, v=T, r=T)
    assert len(record) == 102
    assert record.signals["yaw_rate.tractor"] == pytest.approx(T + [np.nan] * 2, nan_ok=True)


def test_several_rates_and_repeated_timestamps(tmp_path):
    slow = [k - k % 4 for k in range(100)]
    t_imu = [T[k] + 0.013 for k in slow]
    toml = "[signals.speed]\ncolumn='v'\ntime='t_v'\n[signals.yaw_rate.tractor]\ncolumn='r'\ntime='t_imu'\n"
    record = read_table(tmp_path, toml, t_imu=t_imu, r=[T[k] for k in slow], t_v=T, v=T)  # the rows have no time
    assert record.time == pytest.approx(t_imu[::4])
    assert record.signals["yaw_rate.tractor"] == pytest.approx(T[::4])
    assert record.signals["speed"] == pytest.approx(t_imu[::4])
    with pytest.raises(SignalError, match=r"roll\.tractor has no timestamps"):
        read_table(tmp_path, toml + "[signals.roll]\ntractor = {column = 'r'}", t_imu=t_imu, r=T, t_v=T, v=T)
    with pytest.raises(SignalError, match="t_imu: goes back"):
        read_table(tmp_path, toml, t_imu=t_imu[::-1], r=T, t_v=T, v=T)
    with pytest.raises(SignalError, match=r"0 instants in all channels together"):
        read_table(tmp_path, "[signals.roll.tractor]\ncolumn='r'\ntime='t_r'", t_r=[float("nan")] * 3, r=[1, 2, 3])


def test_an_input_is_not_interpolated_across_a_gap(tmp_path):
    t_v = [t if t < 4 else t + 3 for t in T]
    toml = "[signals]\n'roll.tractor'='r'\n[signals.speed]\ncolumn='v'\ntime='t_v'"
    record = read_table(tmp_path, toml, t=T, r=T, t_v=t_v, v=T)
    gap = (record.time > 3.95) & (record.time < 6.95)
    assert (np.isnan(record.signals["speed"]) == gap).all()
    with pytest.raises(SignalError, match=r"speed: missing from 3\.90 to 7\.00 s"):
        record.input("speed")


def test_columns_with_names_of_signals_complete_the_map(tmp_path):
    columns = {"t": T, "vx": T, "yaw_rate.tractor": T, "roll_rate.tractor": T, "reference.roll.tractor": T}
    record = read_table(tmp_path, "[signals]\nspeed = 'vx'", **columns)
    assert list(record.signals) == ["speed", "yaw_rate.tractor", "roll_rate.tractor"]
    assert list(record.reference) == ["roll.tractor"]
    record = read_table(tmp_path, "ignore = ['roll_rate.tractor']\n[signals]\nspeed = 'vx'", **columns)
    assert list(record.signals) == ["speed", "yaw_rate.tractor"]
    record = read_table(tmp_path, "[signals]\nspeed = 'vx'\n'yaw_rate.semitrailer' = 'yaw_rate.tractor'", **columns)
    assert list(record.signals) == ["speed", "yaw_rate.semitrailer", "roll_rate.tractor"]


def test_a_sum_is_on_the_time_base_of_its_first_column(tmp_path):
    slow = [k - k % 4 for k in range(100)]
    toml = "[signals.'yaw_rate.semitrailer']\nsum = ['r', 'dr']\n"
    record = read_table(tmp_path, toml, t=T, r=T, dr=[T[k] for k in slow])
    assert record.signals["yaw_rate.semitrailer"] == pytest.approx(np.array(T) + np.array(T)[slow])


def test_asynchronous_time_bases_are_resampled(tmp_path):
    n = 3000
    t = (np.arange(n) * 0.01).round(6)
    columns = {"t1": t, "t2": t + 0.0031, "t3": t + 0.0067, "v": 0 * t + 10, "a": np.sin(t), "b": np.sin(t + 0.0031)}
    toml = """
        [signals]
        speed = {column = "v", time = "t3"}
        "yaw_rate.tractor" = {column = "a", time = "t1"}
        "yaw_rate.semitrailer" = {column = "b", time = "t2"}
        [time]
        rate = 50
    """
    record = read_table(tmp_path, toml, **{name: values.tolist() for name, values in columns.items()})
    assert record.rate == pytest.approx(50)
    for name in ("yaw_rate.tractor", "yaw_rate.semitrailer"):
        seen = np.isfinite(record.signals[name])
        assert seen.mean() > 0.98
        assert record.signals[name][seen][1:-1] == pytest.approx(np.sin(record.time[seen])[1:-1], abs=2e-4)


def test_spikes_of_all_signals_are_missing(tmp_path):
    """Of inputs, measurements and reference signals; a burst is one spike. A time since 1970 is shifted."""
    columns = {"speed": [20.0] * 100, "yaw_rate.tractor": [0.0] * 100, "reference.roll.tractor": [0.0] * 100}
    columns["speed"][50] = 30.0
    columns["yaw_rate.tractor"][20:22], columns["yaw_rate.tractor"][70] = [0.5, 0.5], -0.5
    columns["reference.roll.tractor"][30] = 0.1
    record = read_table(tmp_path, "", t=[1.5e9 + 0.25 + x for x in T], **columns)
    missing = {name: np.flatnonzero(np.isnan(values)).tolist() for name, values in record.signals.items()}
    assert missing == {"speed": [50], "yaw_rate.tractor": [20, 21, 70]}
    assert np.flatnonzero(np.isnan(record.reference["roll.tractor"])).tolist() == [30]
    assert record.notes == (
        "speed: 1 spike left out, the first 30 m/s at 5.25 s",
        "yaw_rate.tractor: 2 spikes left out, the first 0.5 rad/s at 2.25 s",
        "roll.tractor: 1 spike left out, the first 0.1 rad at 3.25 s",
        "time begins at 2017-07-14 02:40:00.000 UTC, shifted to 0",
    )
    assert record.span == pytest.approx((0.25, 10.15))
    assert record.date == datetime(2017, 7, 14, 2, 40, tzinfo=UTC)
    assert record.started == record.date + timedelta(seconds=float(record.time[0]))
    speed = [20.0] * 300
    speed[120] = 6e4
    record = read_table(tmp_path, "", t=[7.0 + 0.1 * k for k in range(300)], speed=speed)
    assert record.notes == ("speed: 1 impossible sample left out, up to 6e+04 m/s, the first at 19.00 s",)
    part = read_table(tmp_path, "[time]\nstart = '2 s'\nstop = 5.05\n[signals]\nspeed = 'v'", t=T, v=T)
    assert part.span == (2.0, 5.0)


def test_a_map_names_no_database_outside_of_its_folder(tmp_path: Path) -> None:
    folder = tmp_path / "from a stranger"
    (folder / "below").mkdir(parents=True)
    (tmp_path / "secret.dbc").write_text("root:secret:")
    (folder / "link.dbc").symlink_to(tmp_path / "secret.dbc")
    path = folder / "signals.toml"
    for place in ("/etc/shadow", "../secret.dbc", "below/../../secret.dbc", "link.dbc", "a\\u0000b"):
        path.write_text(f'databases = ["{place}"]')
        with pytest.raises(SignalError, match=r"signals\.toml: databases: .*outside of the folder.*allow_outside=True"):
            SignalMap.load(path)
        assert len(SignalMap.load(path, allow_outside=True).databases) == 1
    path.write_text(f"databases = ['drive.dbc', 'below/trailer.dbc', './below/../drive.dbc', '{folder}/drive.dbc']")
    (tmp_path / "link").symlink_to(folder, target_is_directory=True)
    for same in (path, tmp_path / "link" / "signals.toml"):
        assert len(SignalMap.load(same).databases) == 4
