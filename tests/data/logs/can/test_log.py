"""A log of frames as columns of signals."""

import numpy as np
import pytest

from fifthwheel.base.errors import SignalError
from fifthwheel.data.logs import readers
from fifthwheel.data.logs.can.log import CanLog, Frames, open_can_log
from tests.data.logs.can.test_database import DBC
from tests.data.logs.can.wires import FORMATS, message, vdc2, write
from tests.data.logs.readers.reading import read

VDC2_0B, VDC2_3E, VW = 0x18F0090B, 0x0CF0093E, 0x18FEEA03


def log_of(*rows: tuple, databases=(), batch: int = 1000) -> CanLog:
    """A log of (time, id, payload[, bus]) rows; an id above 11 bits has 29."""
    batches = []
    for first in range(0, len(rows), batch):
        some = rows[first : first + batch]
        width = max(8, *(len(row[2]) for row in some))
        frames = Frames(
            time=np.array([row[0] for row in some], float),
            id=np.array([row[1] for row in some], np.uint32),
            extended=np.array([row[1] > 0x7FF for row in some]),
            bus=np.array([row[3] if len(row) > 3 else 0 for row in some], np.int32),
            data=np.array([list(row[2].ljust(width, b"\0")) for row in some], np.uint8),
            length=np.array([len(row[2]) for row in some], np.int32),
        )
        batches.append((frames, (first + len(some)) / len(rows)))
    return open_can_log("a.log", lambda notes: iter(batches), databases)


@pytest.mark.parametrize("kind", FORMATS)
def test_known_values_come_back_from_every_format(tmp_path, kind):
    """Of two gyros on one bus."""
    time = 1.7e9 + 0.01 * np.arange(300)
    rate = 0.3 * np.sin(np.arange(300) / 20)
    pairs = list(zip(time, rate, strict=True))
    rows = [
        message(at + late, number, vdc2(w + more))
        for at, w in pairs
        for number, late, more in ((VDC2_0B, 0.0, 0.0), (VDC2_3E, 0.001, 0.1))
    ]
    told = []
    log = readers.open_log(write(tmp_path / f"a.{kind}", rows), progress=told.append)
    assert log.columns["VDC2.yaw_rate@0B"].unit == "rad/s"
    assert log.columns["VDC2.yaw_rate@0B"].clock == "VDC2@0B"
    with pytest.raises(SignalError, match="several sources"):
        log.find("VDC2.yaw_rate")
    found = read(log, "VDC2.yaw_rate@0B", "VDC2.yaw_rate@3E")
    at, values = found["VDC2.yaw_rate@0B"]
    assert np.allclose(values, rate, atol=0.51 / 8192)
    assert np.allclose(found["VDC2.yaw_rate@3E"][1], rate + 0.1, atol=0.51 / 8192)
    assert np.allclose(at - at[0], time - time[0], atol=1e-3)
    assert told[-1] == 1.0
    assert read(log, "VDC2.yaw_rate@0B").keys() == {"VDC2.yaw_rate@0B"}  # and once more


def test_a_message_on_two_buses_has_the_bus_in_its_name(tmp_path):
    path = tmp_path / "a.dbc"
    path.write_text(DBC)
    motor = (4000).to_bytes(2, "little") + bytes(6)
    rows = [(0.1 * k, VDC2_0B, vdc2(0.1 * bus), bus) for k in range(5) for bus in (0, 1)]
    rows += [(0.1 * k, 100, motor, bus) for k in range(5) for bus in (0, 2)]
    rows += [(0.1 * k, VDC2_3E, vdc2(0.0), 1) for k in range(5)]
    log = log_of(*sorted(rows, key=lambda row: row[0]), databases=[path])
    assert {name for name in log.columns if "yaw" in name} == {
        "VDC2.yaw_rate@0B:0", "VDC2.yaw_rate@0B:1", "VDC2.yaw_rate@3E"
    }  # fmt: skip
    assert {name for name in log.columns if "Speed" in name} == {"Motor.Speed@:0", "Motor.Speed@:2"}
    assert log.columns["Motor.Speed@:2"].clock == "Motor@:2"
    found = read(log, *log.columns)
    assert np.allclose(found["VDC2.yaw_rate@0B:1"][1], 0.1, atol=1e-4)
    assert (found["Motor.Speed@:2"][1] == 1000.0).all()


def test_error_and_not_available_are_nan(tmp_path):
    """Not in a message with 11 bits. A short frame has the signals that fit."""
    for raw, good in ((0xFAFF, True), (0xFB00, False), (0xFE12, False), (0xFFFF, False), (0, True)):
        payload = b"\xff\xff\xff" + raw.to_bytes(2, "little") + b"\xff\xff\xff"
        log = log_of(*((0.01 * k, VDC2_0B, payload) for k in range(3)))
        found = read(log, *log.columns)
        assert np.isfinite(found["VDC2.yaw_rate@0B"][1]).all() == good
        assert np.isnan(found["VDC2.steering_wheel_turn_counter@0B"][1]).all()
        assert np.isnan(found["VDC2.longitudinal_acceleration@0B"][1]).all()
    path = tmp_path / "a.dbc"
    path.write_text(DBC)
    log = log_of((0.0, 100, b"\xff" * 8), (0.1, 100, b"\xff" * 8), databases=[path])
    assert (read(log, "Motor.Speed")["Motor.Speed"][1] == 0.25 * 0xFFFF).all()
    log = log_of((0.0, VDC2_0B, vdc2(0.1)), (0.1, VDC2_0B, vdc2(0.2)[:5]), (0.2, VDC2_0B, vdc2(0.3)[:4]))
    found = read(log, "VDC2.yaw_rate@0B", "VDC2.lateral_acceleration@0B")
    assert np.isnan(found["VDC2.yaw_rate@0B"][1]).tolist() == [False, False, True]
    assert np.isnan(found["VDC2.lateral_acceleration@0B"][1]).tolist() == [False, True, True]


def test_each_axle_of_vehicle_weight_is_a_column_with_a_clock_of_its_own():
    def weight(place: int, kg: float) -> bytes:
        return bytes([place]) + round(2 * kg).to_bytes(2, "little") + (9000).to_bytes(2, "little") + b"\xff\xff\xff"

    log = log_of(
        *(
            (k + 0.1 * n, VW, weight(place, 5000 + 100 * n))
            for k in range(4)
            for n, place in enumerate((0x1F, 0x20, 0x31))
        )
    )
    axles = {"VW.axle_weight_1@03": 5000, "VW.axle_weight_2@03": 5100, "VW.axle_weight_3_tyre_1@03": 5200}
    assert {name for name in log.columns if "axle_weight" in name} == set(axles)
    assert len({log.columns[name].clock for name in axles}) == 3
    found = read(log, *log.columns)
    for name, kg in axles.items():
        assert found[name][1].tolist() == [kg] * 4
    assert found["VW.trailer_weight@03"][1].tolist() == [18000.0] * 12
    assert np.isnan(found["VW.cargo_weight@03"][1]).all()


def test_frames_that_do_not_follow_in_time_are_left_out_and_counted_once(monkeypatch):
    """A clock that was set back is left to whoever reads on. Many frames are read again."""
    times = [0.0, 0.1, 0.1, 0.2, 0.15, 0.3, -5.0, 0.4]
    for kept in (1000, 2):
        monkeypatch.setattr("fifthwheel.data.logs.can.log._KEPT_FRAMES", kept)
        log = log_of(*((at, VDC2_0B, vdc2(0.0)) for at in times), batch=3)
        for _ in range(2):
            assert read(log, "VDC2.yaw_rate@0B")["VDC2.yaw_rate@0B"][0].tolist() == [0.0, 0.1, 0.2, 0.3, 0.4]
        assert [note.partition(":")[0] for note in log.notes] == ["3 frames left out"]
    times = [10.0, 10.1, 10.2, 0.0, 0.1, 0.2, 0.3]
    log = log_of(*((at, VDC2_0B, vdc2(0.0)) for at in times))
    assert read(log, "VDC2.yaw_rate@0B")["VDC2.yaw_rate@0B"][0].tolist() == times


def test_what_no_database_knows_is_told():
    log = log_of((0.0, VDC2_0B, vdc2(0.0)), (0.1, 0x18FECA00, bytes(8)), (0.2, 0x123, bytes(8)))
    assert log.notes == ["2 of 3 ids are in no database; give a DBC to read them"]
    with pytest.raises(SignalError, match=r"a\.log: 2 CAN frames, but no database has .* 123, 18FECA00; give the DBC"):
        log_of((0.1, 0x18FECA00, bytes(8)), (0.2, 0x123, bytes(8)))
    with pytest.raises(SignalError, match=r"no column 'VDC2\.jaw_rate@0B'"):
        list(log.chunks(["VDC2.jaw_rate@0B"]))


@pytest.mark.slow
def test_real_trucks(data):
    """One that stands, one that drives, and a trace with error lines."""
    log = readers.open_log(data / "j1939" / "navistar_a26_vdc2_only.candump.log")
    time, rate = read(log, "VDC2.yaw_rate@0B")["VDC2.yaw_rate@0B"]
    assert np.median(np.diff(time)) == pytest.approx(0.01, abs=5e-4)
    assert rate.mean() == pytest.approx(3.7e-3, abs=5e-5)
    assert rate.std() == pytest.approx(5.4e-4, abs=1e-5)
    assert "CCVS.wheel_based_vehicle_speed@00:1" in log.columns
    assert log.notes == []
    log = readers.open_log(data / "j1939" / "csu_normal_drive.log")
    (at, speed), (also, front) = read(log, "CCVS.wheel_based_vehicle_speed@00", "EBC2.front_axle_speed@0B").values()
    assert np.ptp(at) == pytest.approx(30, abs=1)
    assert speed.max() == pytest.approx(55, abs=0.5)
    assert np.abs(np.interp(also, at, speed) - front).max() < 1.5
    log = readers.open_log(data / "j1939" / "paccar_mx_pcanview.trc")
    assert log.notes == ["250 error frames left out", "47 of 51 ids are in no database; give a DBC to read them"]
    assert len(read(log, "CCVS.wheel_based_vehicle_speed@00")["CCVS.wheel_based_vehicle_speed@00"][0]) == 769
