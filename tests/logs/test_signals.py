import textwrap

import numpy as np
import pytest

import fifthwheel.logs.signals as module
from fifthwheel.errors import SignalError
from fifthwheel.logs import SignalMap, read


def reading(tmp_path, toml, **columns):
    rows = zip(*columns.values(), strict=True)
    (tmp_path / "log.csv").write_text("\n".join([",".join(columns), *(",".join(map(repr, row)) for row in rows), ""]))
    return read(tmp_path / "log.csv", SignalMap.parse(toml))


T = (np.arange(100) * 0.1).round(6).tolist()


def test_the_example_in_the_documentation_holds(tmp_path):
    toml = textwrap.dedent(module.__doc__.partition("\n\n")[2])
    (tmp_path / "signals.toml").write_text(toml)
    parsed = SignalMap.load(tmp_path / "signals.toml")
    assert parsed == SignalMap.parse(toml)
    assert parsed.signals["steer.tractor.front"].delay == pytest.approx(0.2)
    assert parsed.signals["speed"].column == "vx [km/h]"


def test_unit_sign_gain_offset_and_sum(tmp_path):
    toml = """
        [time]
        column = "ms"
        unit = "ms"
        [signals.steer.tractor.front]
        column = "wheel"
        unit = "deg"
        sign = -1
        gain = 0.05
        offset = "0.1 deg"
        [signals."yaw_rate.semitrailer"]
        sum = ["r", "dr"]
        offset = 0.5
        [reference]
        "roll.tractor" = "phi"
    """
    made = reading(tmp_path, toml, ms=[0, 10, 20], wheel=[20, 40, 60], r=[1, 2, 3], dr=[0.5, 0.5, 0.5], phi=[1, 2, 3])
    assert made.time == pytest.approx([0, 0.01, 0.02])
    assert made.signals["steer.tractor.front"] == pytest.approx(np.radians([-1.1, -2.1, -3.1]))
    assert made.signals["yaw_rate.semitrailer"] == pytest.approx([1, 2, 3])
    assert made.reference["roll.tractor"] == pytest.approx([1, 2, 3])


@pytest.mark.parametrize(
    ("toml", "message"),
    [
        ("[signals.speed]\ncolum = 'v'", r"signals\.speed\.colum: unknown key; did you mean 'column'"),
        ("[time]\ncolumn = 't'\nunits = 's'\n[signals]\nspeed = 'v'", r"time\.units: unknown key; did you mean 'unit'"),
        ("[signal]\nspeed = 'v'", "signal: unknown key; did you mean 'signals'"),
        ("[signals]\n'yaw_rte.tractor' = 'r'", r"signals: yaw_rte\.tractor: .*did you mean 'yaw_rate\.tractor'"),
        ("[signals.speed]\ncolumn = 'v'\nsum = ['a']", "either column = ... or sum"),
        ("[signals.speed]\nunit = 'm/s'", "either column = ... or sum"),
        ("[signals.speed]\ncolumn = 'v'\nsign = 2", "sign: input should be 1 or -1, got 2"),
        ("[signals.speed]\ncolumn = 'v'\nunit = 'deg'", "speed: unit 'deg' does not fit: expected one of m/s"),
        ("[signals.speed]\ncolumn = 'v'\noffset = '1 deg'", "speed: unit 'deg' does not fit"),
        ("[signals.speed]\ncolumn = 'v'\ndelay = '1 m'", "delay: unit 'm' does not fit"),
        ("[signals.speed]\ncolumn = 'v'\ngain = nan", r"signals\.speed\.gain: input should be a finite number"),
        ("[signals.speed]\ncolumn = 'v'\npoints = [[1, 2], [1, 3]]", "must increase from pair to pair"),
        ("[signals.speed]\ncolumn = 'v'\npoints = [[1, 2]]", "a calibration needs two pairs"),
        ("[signals]\n'yaw_rate.a' = 'r'\n'yaw_rate.b' = 'r'", r"column 'r' cannot be both yaw_rate\.a and yaw_rate\.b"),
        ("[time]\nrate = 0", "at least 1 Hz"),
        ("signals = 3", "signals: .*got 3"),
        ("[signals", "not TOML"),
    ],
)
def test_faults_of_the_map_name_the_cure(toml, message):
    with pytest.raises(SignalError, match=message):
        SignalMap.parse(toml)


def test_an_absent_map_and_absent_columns(tmp_path):
    with pytest.raises(SignalError, match="cannot be read"):
        SignalMap.load(tmp_path / "none.toml")
    with pytest.raises(SignalError, match="no column 'velocty'; did you mean 'velocity'"):
        reading(tmp_path, "[signals]\nspeed = 'velocty'", t=[0, 1], velocity=[1, 2])


def test_a_delayed_measurement_keeps_its_samples_at_their_own_instants(tmp_path):
    toml = "[signals]\nspeed = 'v'\n[signals.'yaw_rate.tractor']\ncolumn = 'r'\ndelay = '30 ms'"
    made = reading(tmp_path, toml, t=T, v=T, r=T)
    assert len(made) == 200
    rate, speed = made.signals["yaw_rate.tractor"], made.signals["speed"]
    taken = np.isfinite(rate)
    assert rate[taken] == pytest.approx(T)
    assert made.time[taken] == pytest.approx(np.array(T) - 0.03)
    assert np.isnan(speed[0])  # before the first row: nothing is extrapolated
    assert speed[1:] == pytest.approx(made.time[1:])


def test_a_delay_of_whole_rows_shares_their_instants(tmp_path):
    toml = "[signals]\nspeed = 'v'\n[signals.'yaw_rate.tractor']\ncolumn = 'r'\ndelay = 0.2"
    made = reading(tmp_path, toml, t=T, v=T, r=T)
    assert len(made) == 102
    assert made.signals["yaw_rate.tractor"][:100] == pytest.approx(T)
    assert np.isnan(made.signals["yaw_rate.tractor"][100:]).all()


def test_a_delayed_input_is_interpolated_on_the_rows(tmp_path):
    toml = "[signals]\n'yaw_rate.tractor' = 'r'\n[signals.'steer.tractor.front']\ncolumn = 'd'\ndelay = 0.25"
    made = reading(tmp_path, toml, t=T, r=T, d=T)
    assert made.time == pytest.approx(T)
    steer = made.signals["steer.tractor.front"]
    assert steer[:97] == pytest.approx(made.time[:97] + 0.25)
    assert np.isnan(steer[97:]).all()


def test_several_rates_and_held_stamps(tmp_path):
    slow = [k - k % 4 for k in range(100)]
    t_imu = [T[k] + 0.013 for k in slow]
    toml = "[signals.speed]\ncolumn='v'\ntime='t_v'\n[signals.yaw_rate.tractor]\ncolumn='r'\ntime='t_imu'\n"
    made = reading(tmp_path, toml, t_imu=t_imu, r=[T[k] for k in slow], t_v=T, v=T)  # no time of the rows at all
    assert made.time == pytest.approx(t_imu[::4])
    assert made.signals["yaw_rate.tractor"] == pytest.approx(T[::4])
    assert made.signals["speed"] == pytest.approx(t_imu[::4])
    with pytest.raises(SignalError, match=r"no time for roll\.tractor, neither"):
        reading(tmp_path, toml + "[signals.roll]\ntractor = {column = 'r'}", t_imu=t_imu, r=T, t_v=T, v=T)
    with pytest.raises(SignalError, match="t_imu: goes back"):
        reading(tmp_path, toml, t_imu=t_imu[::-1], r=T, t_v=T, v=T)


def test_an_input_is_not_drawn_across_a_hole_of_its_clock(tmp_path):
    t_v = [t if t < 4 else t + 3 for t in T]
    made = reading(
        tmp_path, "[signals]\n'roll.tractor'='r'\n[signals.speed]\ncolumn='v'\ntime='t_v'", t=T, r=T, t_v=t_v, v=T
    )
    hole = (made.time > 3.95) & (made.time < 6.95)
    assert np.isnan(made.signals["speed"][hole]).all()
    assert np.isfinite(made.signals["speed"][~hole]).all()
    with pytest.raises(SignalError, match=r"speed: .* missing"):
        made.input("speed")


def test_clocks_that_never_tick(tmp_path):
    toml = "[signals.roll.tractor]\ncolumn='r'\ntime='t_r'"
    with pytest.raises(SignalError, match=r"0 instants in all channels together"):
        reading(tmp_path, toml, t_r=[float("nan")] * 3, r=[1, 2, 3])


def test_a_map_of_some_columns_leaves_those_that_need_none(tmp_path):
    columns = {"t": T, "vx": T, "yaw_rate.tractor": T, "roll_rate.tractor": T, "reference.roll.tractor": T}
    made = reading(tmp_path, "[signals]\nspeed = 'vx'", **columns)
    assert list(made.signals) == ["speed", "yaw_rate.tractor", "roll_rate.tractor"]
    assert list(made.reference) == ["roll.tractor"]
    made = reading(tmp_path, "ignore = ['roll_rate.tractor']\n[signals]\nspeed = 'vx'", **columns)
    assert list(made.signals) == ["speed", "yaw_rate.tractor"]
    made = reading(tmp_path, "[signals]\nspeed = 'vx'\n'yaw_rate.semitrailer' = 'yaw_rate.tractor'", **columns)
    assert list(made.signals) == ["speed", "yaw_rate.semitrailer", "roll_rate.tractor"]


def test_a_part_of_a_log(tmp_path):
    made = reading(tmp_path, "[time]\nstart = '2 s'\nstop = 5.05\n[signals]\nspeed = 'v'", t=T, v=T)
    assert made.span == (2.0, 5.0)


def test_columns_of_several_clocks_are_added_on_the_first(tmp_path):
    slow = [k - k % 4 for k in range(100)]
    toml = "[signals.'yaw_rate.semitrailer']\nsum = ['r', 'dr']\n"
    made = reading(tmp_path, toml, t=T, r=T, dr=[T[k] for k in slow])
    assert made.signals["yaw_rate.semitrailer"] == pytest.approx(np.array(T) + np.array(T)[slow])


def test_clocks_that_tick_apart_meet_on_a_common_base(tmp_path):
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
    made = reading(tmp_path, toml, **{name: values.tolist() for name, values in columns.items()})
    assert made.rate == pytest.approx(50)
    for name in ("yaw_rate.tractor", "yaw_rate.semitrailer"):
        seen = np.isfinite(made.signals[name])
        assert seen.mean() > 0.98
        assert made.signals[name][seen][1:-1] == pytest.approx(np.sin(made.time[seen])[1:-1], abs=2e-4)


def test_samples_that_no_sensor_shows_are_missing(tmp_path):
    speed = [20.0] * 400
    speed[7], speed[90] = 1e200, float("inf")
    made = reading(tmp_path, "[signals]\nspeed = 'v'", t=np.arange(400.0).tolist(), v=speed)
    assert np.flatnonzero(np.isnan(made.signals["speed"])).tolist() == [7, 90]
    assert made.notes == ("speed: 2 samples left out that no sensor shows, up to inf m/s",)
    made = reading(tmp_path, "[signals]\n'yaw_rate.tractor' = 'r'", t=T, r=[900.0] * 100)
    assert made.signals["yaw_rate.tractor"] == pytest.approx(900)  # a unit, not a bit: check() names it


def test_a_time_since_1970_counts_from_the_start(tmp_path):
    made = reading(tmp_path, "[signals]\nspeed = 'v'", t=[1.5e9 + 0.25 + x for x in T], v=T)
    assert made.span == pytest.approx((0.25, 10.15))
    assert made.notes == ("time counts from 2017-07-14 02:40:00 UTC",)
