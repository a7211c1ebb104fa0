"""One run in every supported format, written by independent libraries."""

import json
import struct
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np

from fifthwheel.data.channels import header
from fifthwheel.data.logs import SignalMap, write_record
from fifthwheel.data.record import Record

DBC = """VERSION ""
BU_: X
BO_ 2566844670 Drive1: 8 X
 SG_ speed : 0|32@1- (1,0) [0|0] "m/s" X
 SG_ steer : 32|32@1- (1,0) [0|0] "rad" X
BO_ 2566845182 Gyro1: 8 X
 SG_ yaw_rate : 0|32@1- (1,0) [0|0] "rad/s" X
 SG_ roll_rate : 32|32@1- (1,0) [0|0] "rad/s" X
BO_ 1111 Gyro2: 8 X
 SG_ yaw_rate : 0|32@1- (1,0) [0|0] "rad/s" X
 SG_ roll_rate : 32|32@1- (1,0) [0|0] "rad/s" X
SIG_VALTYPE_ 2566844670 speed : 1;
SIG_VALTYPE_ 2566844670 steer : 1;
SIG_VALTYPE_ 2566845182 yaw_rate : 1;
SIG_VALTYPE_ 2566845182 roll_rate : 1;
SIG_VALTYPE_ 1111 yaw_rate : 1;
SIG_VALTYPE_ 1111 roll_rate : 1;
"""
FRAMES = {
    (2566844670 & 0x1FFFFF00 | 0x27, True): ("speed", "steer.tractor.front"),
    (2566845182 & 0x1FFFFF00 | 0x0B, True): ("yaw_rate.tractor", "roll_rate.tractor"),
    (1111, False): ("yaw_rate.semitrailer", "roll_rate.semitrailer"),
}
CAN_MAP = """
databases = ["drive.dbc"]
[signals]
speed = "Drive1.speed"
"steer.tractor.front" = "Drive1.steer"
"yaw_rate.tractor" = "Gyro1.yaw_rate@0B"
"roll_rate.tractor" = "Gyro1.roll_rate"
"yaw_rate.semitrailer" = "Gyro2.yaw_rate"
"roll_rate.semitrailer" = "Gyro2.roll_rate"
"""


def _plain(record: Record, path: Path) -> None:
    write_record(record, path)


def _mf4(record: Record, path: Path) -> None:
    from asammdf import MDF, Signal

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        mdf = MDF(version="4.10")
        for place in ("", "tractor", "semitrailer"):
            mdf.append(
                [
                    Signal(values, record.time, name=name, unit="m/s" if name == "speed" else "rad/s")
                    for name, values in record.signals.items()
                    if name.partition(".")[2].startswith(place) and bool(place) == ("." in name) and "steer" not in name
                ]
            )
        mdf.append([Signal(record.signals["steer.tractor.front"], record.time, name="steer.tractor.front", unit="rad")])
        mdf.save(path, overwrite=True, compression=2)
        mdf.close()


def _mat5(record: Record, path: Path) -> None:
    from scipy.io import savemat

    savemat(path, {"t": record.time, **{n.replace(".", "_"): v for n, v in record.signals.items()}})


def _mat73(record: Record, path: Path) -> None:
    import h5py

    with h5py.File(path, "w", userblock_size=512) as file:
        for name, values in {"t": record.time, **record.signals}.items():
            data = file.create_dataset(name.replace(".", "_"), data=values[None, :])
            data.attrs["MATLAB_class"] = np.bytes_("double")
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM")


def _mcap(record: Record, path: Path) -> None:
    from mcap.writer import Writer

    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema(name="drive", encoding="jsonschema", data=b'{"type": "object"}')
        channel = writer.register_channel(topic="/drive", message_encoding="json", schema_id=schema)
        for k, time in enumerate(record.time):
            data = {name.replace(".", "_"): float(values[k]) for name, values in record.signals.items()}
            stamp = round(time * 1e9)
            writer.add_message(channel, log_time=stamp, publish_time=stamp, data=json.dumps(data).encode())
        writer.finish()


def _tdms(record: Record, path: Path) -> None:
    from nptdms import ChannelObject, TdmsWriter

    waveform = {"wf_increment": float(np.diff(record.time).mean()), "wf_start_offset": float(record.time[0])}
    with TdmsWriter(path) as writer:
        for part in np.array_split(np.arange(len(record)), 3):
            channels = [
                ChannelObject(
                    "drive", name, values[part], waveform | {"unit_string": "m/s" if name == "speed" else "rad/s"}
                )
                for name, values in record.signals.items()
                if "steer" not in name
            ]
            steer = record.signals["steer.tractor.front"][part]
            writer.write_segment([*channels, ChannelObject("drive", "steer.tractor.front", steer, waveform)])


def _ulog(record: Record, path: Path) -> None:
    def message(kind: str, body: bytes) -> bytes:
        return struct.pack("<HB", len(body), ord(kind)) + body

    fields = "".join(f"double {name.replace('.', '_')};" for name in record.signals)
    content = b"ULog\x01\x12\x35\x01" + bytes(8) + message("F", f"drive:uint64_t timestamp;{fields}".encode())
    rows = zip(record.time, *record.signals.values(), strict=True)
    rest = (struct.pack(f"<HQ{len(record.signals)}d", 0, round(time * 1e6), *values) for time, *values in rows)
    path.write_bytes(content + message("A", b"\0\0\0drive") + b"".join(message("D", body) for body in rest))


def _xlsx(record: Record, path: Path) -> None:
    from openpyxl import Workbook

    book = Workbook(write_only=True)
    book.create_sheet("About").append(["a simulation"])
    sheet = book.create_sheet("Drive")
    sheet.append(["time [s]", *map(header, record.signals)])
    for row in zip(record.time, *record.signals.values(), strict=True):
        sheet.append([float(value) for value in row])
    book.save(path)


def _frames(kind: str) -> Callable[[Record, Path], None]:
    def write_frames(record: Record, path: Path) -> None:
        import can

        writers = {"asc": can.ASCWriter, "blf": can.BLFWriter, "candump": can.CanutilsLogWriter, "trc": can.TRCWriter}
        (path.parent / "drive.dbc").write_text(DBC)
        with writers[kind](str(path)) as writer:
            for k, time in enumerate(record.time):
                for (number, extended), names in FRAMES.items():
                    data = np.array([record.signals[name][k] for name in names], dtype="<f4").tobytes()
                    message = can.Message(
                        timestamp=1.7e9 + time, arbitration_id=number, is_extended_id=extended, data=data, channel=1
                    )
                    writer.on_message_received(message)

    return write_frames


_FLAT = "[signals]\nspeed = 'speed'\n" + "".join(
    f"'{name}' = '{name.replace('.', '_')}'\n" for names in FRAMES.values() for name in names if "." in name
)
_TOPIC = "[signals]\n" + "".join(
    f"'{name}' = 'drive.{name.replace('.', '_')}'\n" for names in FRAMES.values() for name in names
)
FORMATS: dict[str, tuple[Callable[[Record, Path], None], str]] = {
    "drive.csv": (_plain, ""),
    "drive.parquet": (_plain, ""),
    "drive.mf4": (_mf4, ""),
    "v5.mat": (_mat5, _FLAT),
    "v73.mat": (_mat73, _FLAT),
    "drive.mcap": (_mcap, _TOPIC),
    "drive.tdms": (_tdms, ""),
    "drive.ulg": (_ulog, _TOPIC),
    "drive.xlsx": (_xlsx, ""),
    "drive.asc": (_frames("asc"), CAN_MAP),
    "drive.blf": (_frames("blf"), CAN_MAP),
    "candump.log": (_frames("candump"), CAN_MAP),
    "drive.trc": (_frames("trc"), CAN_MAP),
}
"""File name, the function that writes the file, and the map that reads it."""


def stored(record: Record, folder: Path, name: str) -> tuple[Path, SignalMap]:
    """Path of the record in a file of this name, and its map."""
    writer, toml = FORMATS[name]
    writer(record, folder / name)
    if not toml:
        return folder / name, SignalMap()
    (folder / f"{name}.toml").write_text(toml)
    return folder / name, SignalMap.load(folder / f"{name}.toml")
