"""Damaged and hostile files of every kind that fifthwheel reads, and what becomes of them.

    python benchmarks/fuzz.py                        # all kinds, about 20 minutes of CPU
    python benchmarks/fuzz.py --seconds 20 drive.csv signals.toml
    python benchmarks/fuzz.py --seed 7 --keep found  # keep the files that gave a foreign exception or blocked
    python benchmarks/fuzz.py --files 12 --every 151  # what a slow test reads

A valid file is damaged by flipped bits, cuts, moved, repeated and zeroed blocks, extreme numbers and, in text, words of
other kinds. A log is read as a record; every tenth is also surveyed, and the map proposed for it is read again. Hostile
files are TOML with an unexpected value for every key, and logs with hostile names, times and values. Warnings count as
foreign exceptions. Needs the test extra; run it from the root of the project.
"""

import argparse
import contextlib
import itertools
import json
import os
import random
import signal
import sys
import tempfile
import time
import tomllib
import traceback
import warnings
import zlib
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import tomli_w

sys.path.insert(0, str(Path(__file__).parents[1]))

from tests.data.logs.formats import CAN_MAP, DBC, FORMATS, stored

from fifthwheel.apps.workflow.inputs import survey_files
from fifthwheel.base.errors import FifthwheelError
from fifthwheel.data.logs import SignalMap, read_log
from fifthwheel.data.logs.can.database import load as load_database
from fifthwheel.data.record import Record
from fifthwheel.estimate.identify import Identification, OneStage, identify
from fifthwheel.model.plant import read_sensors
from fifthwheel.model.simulate import simulate
from fifthwheel.truck import Vehicle, catalogue, get

OUTCOMES = ("read", "refused", "time limit", "memory limit", "crash of the child", "foreign", "hang")
LIMITS = {"SECONDS": "10", "MEMORY": "1000", "SAMPLES": "100"}
LONGEST = 60
"""s; a file that takes longer has blocked the program."""
SENSORS = '["yaw_rate.tractor"]\nbias = "0.1 deg/s"\nnoise = "0.05 deg/s"\nrate = 100\nlatency = "20 ms"\n'
LOG_MAP = """
[time]
column = "t"
unit = "s"
rate = 100
start = 0.1
stop = "1.5 s"
[signals]
speed = "a"
"steer.tractor.front" = {column = "b", unit = "rad", sign = -1, gain = 2.0, offset = "1 deg", delay = "20 ms"}
"yaw_rate.tractor" = {sum = ["c", "d"], points = [[0, 1], [2, 3]], time = "t", clock = "imu"}
"yaw_rate.semitrailer" = {column = "e", time = "d"}
[reference]
"roll.tractor" = "d"
"""
WORDS = [
    *(b"nan", b"inf", b"-1e999", b"9" * 400, b"9" * 5000, b"9**9**9**9 m/s", b"2024-01-01", b"../../etc/passwd"),
    *(b"[" * 300, b"{" * 300, b'"', b"'", b"\n", b"\r", b",", b";", b"=", b" " * 3000),
    *(b"\0", b"\xff\xfe", b"\x1b[2J", b"\xe2\x80\xae"),
]
VALUES: list[Any] = [
    *(
        "",
        "nan",
        "inf",
        "-1",
        "0",
        "1e999 kg",
        "1 kg +- 1e999 kg",
        "9**9**9**9 m/s",
        "x" * 3000,
        "\x1b]0;x\x07",
        "\u202e",
    ),
    *(float("nan"), float("inf"), -1.0, 0, 2**63 - 1, 1e308, 5e-324, True),
    *([], {}, [[]], [{}], {"a": {"b": 1}}, ["x"] * 50),
]
NAMES = [
    *(
        "",
        "time",
        "speed",
        "reference.",
        "reference.speed",
        "yaw_rate.tractor [9**9**9**9 m/s]",
        "steer..",
        ".",
        "@",
        "a@b@c",
    ),
    *(" " * 900, "x" * 5000, "[", "(a", "speed [" + "(" * 30 + "m]", "]" * 50),
    *("a\nb", "\0", "\x1b[2J", "\u202e", "é\u0301"),
]


class Hang(BaseException):
    """The program takes too long."""


def damaged(whole: bytes, rng: random.Random) -> bytes:
    """A file with one or several damages."""
    data = bytearray(whole)
    for _ in range(rng.choice((1, 1, 1, 2, 5))):
        at, size = rng.randrange(len(data) + 1), rng.choice((1, 4, 8, 100, 4096))
        other = rng.randrange(len(data) + 1)
        match rng.randrange(8):
            case 0 if data:
                for _ in range(rng.choice((1, 3, 30, 300))):
                    data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
            case 1:
                del data[at:]
            case 2:
                data[at : at + size], data[other : other + size] = data[other : other + size], data[at : at + size]
            case 3:
                data[at:at] = data[other : other + size]
            case 4:
                data[at : at + size] = bytes(len(data[at : at + size]))
            case 5:
                extreme = rng.choice((b"\xff" * 8, b"\xff" * 7 + b"\x7f", b"\0" * 7 + b"\x80", b"\xff" * 4, b"\x01"))
                data[at : at + len(extreme)] = extreme
            case 6:
                data[at : at + rng.choice((0, 1, 20))] = rng.choice(WORDS)
            case _:
                del data[at : at + size]
    return bytes(data)


def read_as_log(path: Path, signal_map: SignalMap) -> None:
    """The record; of every tenth file, chosen by its content, also survey and proposed map, with or without signals."""
    if zlib.crc32(path.read_bytes()) % 10:
        read_log(path, signal_map)
        return
    with contextlib.suppress(FifthwheelError):
        read_log(path, signal_map)
    SignalMap.parse(survey_files([path], databases=signal_map.databases).signals_toml)


def read_vehicle(path: Path) -> None:
    """The vehicle, its axle loads and its copy."""
    vehicle = Vehicle.load(path)
    vehicle.axle_loads()
    vehicle.derived()
    if Vehicle.loads(vehicle.to_toml()) != vehicle:
        raise AssertionError("the copy differs")


def outcome(read: Callable[[Path], object], path: Path) -> tuple[str, str]:
    """What becomes of a file, and the trace of a foreign exception."""

    def expire(*_: object) -> None:
        raise Hang

    signal.signal(signal.SIGALRM, expire)
    signal.alarm(LONGEST)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            read(path)
    except FifthwheelError as error:
        text = str(error)
        kinds = {"crash of the child": "crashed (", "time limit": "was stopped after", "memory limit": "more than"}
        for kind, words in kinds.items():
            if words in text and "FIFTHWHEEL_READER" in text:
                return kind, ""
        return "refused", ""
    except Hang:
        return "hang", traceback.format_exc()
    except Exception:
        return "foreign", traceback.format_exc()
    finally:
        signal.alarm(0)
    return "read", ""


def values_replaced(table: Any) -> Iterator[Any]:
    """The table with each value in turn replaced by each unexpected one."""
    entries = table.items() if isinstance(table, dict) else enumerate(table) if isinstance(table, list) else ()
    for key, value in list(entries):
        for replacement in [*VALUES, *values_replaced(value)]:
            changed = table.copy()
            changed[key] = replacement
            yield changed


def hostile_toml(text: str) -> Iterator[bytes]:
    for table in values_replaced(tomllib.loads(text)):
        with contextlib.suppress(TypeError, ValueError):
            yield tomli_w.dumps(table).encode()


def hostile_tables(folder: Path, *, kind: str) -> Iterator[bytes]:
    """A table with each pair of hostile names, as CSV or Parquet."""
    values = np.vstack([np.arange(50.0), np.random.default_rng(0).normal(size=(2, 50))])
    for first in NAMES:
        for second in NAMES:
            names = ["time", first, second]
            if kind == "csv":
                rows = "\n".join(",".join(f"{x:.6g}" for x in row) for row in values.T)
                yield (",".join(names) + "\n" + rows + "\n").encode()
                continue
            pq.write_table(pa.Table.from_arrays(list(map(pa.array, values)), names=names), folder / "hostile")
            yield (folder / "hostile").read_bytes()


def hostile_records(record: Record, rng: np.random.Generator) -> Iterator[bytes]:
    """A table in which times or values of every kind are replaced."""
    extremes = [0.0, -0.0, 1e300, -1e300, 5e-324, 1e15, 2.0**63, -1e6, np.nan, np.inf, 1e6]
    for column in range(1 + len(record.signals)):
        for extreme in extremes:
            for count in (1, len(record) // 2):
                table = np.column_stack([record.time, *record.signals.values()])
                rows = rng.choice(len(record), count, replace=False)
                table[rows, column] = rng.choice([extreme, extreme * rng.random()])
                if rng.random() < 0.3:
                    table[count // 2 :, column] += extreme
                text = "\n".join(",".join(map(repr, row)) for row in table.tolist())
                yield (",".join(["time", *record.signals]) + "\n" + text + "\n").encode()


def cases(folder: Path, chosen: list[str]) -> Iterator[tuple[str, bytes | Iterator[bytes], Callable[[Path], object]]]:
    """Kind, valid content to damage or hostile contents, and how it is read."""
    truck = get("cheng_cebon_2011")
    record = simulate(truck, count=1, seed=1)
    record = Record(time=record.time, signals=record.signals, name="drive")
    short = record.cut(0, 0.6)

    def wanted(name: str) -> bool:
        return not chosen or name in chosen

    for name in filter(wanted, FORMATS):
        path, signal_map = stored(short, folder, name)
        yield name, path.read_bytes(), lambda path, signal_map=signal_map: read_as_log(path, signal_map)
    toml = {
        "vehicle.toml": (catalogue.text("cheng_cebon_2011"), read_vehicle),
        "identified.toml": (truck.to_toml(), read_vehicle),
        "signals.toml": (
            CAN_MAP + '[time]\ncolumn = "t"\nrate = "100 Hz"\n["reference"."roll.tractor"]\nsum = ["a", "b"]\n'
            'unit = "deg"\nsign = -1\ngain = 2.0\noffset = "1 deg"\ndelay = "20 ms"\npoints = [[0, 1], [2, 3]]\n',
            SignalMap.load,
        ),
        "sensors.toml": (SENSORS, read_sensors),
    }
    for name, (text, read) in toml.items():
        if wanted(name):
            yield name, text.encode(), read
            yield f"hostile {name}", hostile_toml(text), read
    if wanted("drive.dbc"):
        yield "drive.dbc", DBC.encode(), lambda path: load_database([path])
    if wanted("identification.json"):
        stored_json = folder / "identification.json"
        stored_json.write_text(json.dumps(identify([record], truck, OneStage()).as_dict()))
        yield "identification.json", stored_json.read_bytes(), Identification.load
    for kind in ("csv", "parquet"):
        if wanted(f"hostile names, {kind}"):
            contents = hostile_tables(folder, kind=kind)
            yield f"hostile names, {kind}", contents, lambda path: read_as_log(path, SignalMap())
    if wanted("hostile samples"):
        contents = hostile_records(record, np.random.default_rng(0))
        yield "hostile samples", contents, lambda path: read_as_log(path, SignalMap())
    if wanted("hostile map"):
        table = folder / "plain.csv"
        rows = np.column_stack([short.time, *short.signals.values()])
        np.savetxt(table, rows, delimiter=",", header=",".join("tabcdefgh"[: rows.shape[1]]), comments="")
        yield "hostile map", hostile_toml(LOG_MAP), lambda path: read_log(table, SignalMap.load(path))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("kinds", nargs="*", help="kinds of files; default: all")
    parser.add_argument("--seconds", type=float, default=60.0, help="time for each kind of damaged file, s")
    parser.add_argument("--files", type=int, default=5000, help="most files of each kind")
    parser.add_argument("--every", type=int, default=1, help="read each n-th hostile file only")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--keep", type=Path, help="folder for the files that gave a foreign exception or blocked")
    given = parser.parse_args()
    os.environ.update({f"FIFTHWHEEL_READER_{name}": value for name, value in LIMITS.items()})
    print(f"{'kind':24}{'files':>7}{'s':>7}" + "".join(f"{name:>20}" for name in OUTCOMES))
    seen: set[str] = set()
    with tempfile.TemporaryDirectory() as folder:
        for name, content, read in cases(Path(folder), given.kinds):
            rng, found, start = random.Random(f"{name} {given.seed}"), Counter[str](), time.monotonic()
            path = Path(folder) / ("attacked." + name.rpartition(".")[2] if "names" not in name else "attacked")
            contents = (
                (damaged(content, rng) for _ in range(given.files))
                if isinstance(content, bytes)
                else itertools.islice(content, given.seed % given.every, None, given.every)
            )
            for data in contents:
                path.write_bytes(data)
                kind, trace = outcome(read, path)
                found[kind] += 1
                cause = trace.strip().rpartition("\n")[2] + "".join(trace.splitlines()[-3:-1])
                if kind in ("foreign", "hang") and cause not in seen:
                    seen.add(cause)
                    print(f"\n{name}:\n{trace}", file=sys.stderr, flush=True)
                    if given.keep:
                        given.keep.mkdir(exist_ok=True)
                        (given.keep / f"{len(seen)} {name}").write_bytes(data)
                if isinstance(content, bytes) and time.monotonic() - start > given.seconds:
                    break
            counts = "".join(f"{found[kind]:20}" for kind in OUTCOMES)
            print(f"{name:24}{found.total():7}{time.monotonic() - start:7.0f}{counts}", flush=True)


if __name__ == "__main__":
    main()
