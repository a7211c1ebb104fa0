"""ASAM MDF: written by asammdf, expected values computed here; files of loggers beside asammdf alone; formulas."""

import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fifthwheel.base.errors import SignalError
from fifthwheel.data.logs.readers import open_log as open_isolated_log
from tests.data.logs.readers.reading import read

pytest.importorskip("asammdf")
from asammdf import MDF, Signal, Source

from fifthwheel.data.logs import source
from fifthwheel.data.logs.readers import mdf
from fifthwheel.data.logs.readers.mdf import MAX_FORMULA, evaluate, open_log

T = np.arange(400) / 100
RAW = (np.arange(400) % 160).astype("u1")
TABLE = {f"raw_{k}": k * 20.0 for k in range(8)} | {f"phys_{k}": float(k * k) for k in range(8)}
RANGES = {"lower_0": 0.0, "upper_0": 40.0, "phys_0": 1.0, "lower_1": 60.0, "upper_1": 80.0, "phys_1": 2.0}
SCALE = {"a": 0.5, "b": -10.0}
CONVERSIONS: dict[str, dict[str, Any]] = {
    "linear": {"a": 0.5, "b": 1.0},
    "rational": {"P1": 0.0, "P2": 2.0, "P3": 1.0, "P4": 0.0, "P5": 0.0, "P6": 4.0},
    "interpolated": TABLE | {"interpolation": True},
    "nearest": TABLE | {"interpolation": False},
    "formula": {"formula": "3*X+sin(X)"},
    "states": {"val_0": 0, "text_0": b"off", "val_1": 1, "text_1": b"on"},
}
EXPECTED = {
    "linear": RAW * 0.5 + 1,
    "rational": (2.0 * RAW + 1) / 4,
    "interpolated": np.interp(RAW, np.arange(8) * 20.0, np.arange(8.0) ** 2),
    "nearest": np.ceil(RAW / 20 - 0.5).clip(0, 7) ** 2,
    "formula": 3.0 * RAW + np.sin(RAW.astype(float)),
    "states": RAW.astype(float),
}


def save(path: Path, *groups: Any, version: Any = "4.10", compression: Any = 0, **more: Any) -> Path:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        file = MDF(version=version, **more)
        for signals, label in groups:
            file.append(signals, acq_name=label)
        saved = file.save(path, overwrite=True, compression=compression)
        file.close()
    return Path(saved)


@pytest.mark.parametrize(
    ("version", "compression"),
    [("2.14", 0), ("3.30", 0), ("4.00", 0), ("4.10", 1), ("4.20", 2), ("4.30", 3), ("4.30", 6)],
)  # 3: zstd, 6: LZ4
def test_what_asammdf_writes(tmp_path: Path, version: str, compression: int) -> None:
    kinds = ["i1", "i2", "i4", "i8", "u2", "u4", "u8", "f4", "f8", ">i2", ">f8", "?"]
    numbers = {kind: (np.arange(400) * 0.3 - 40 * ("u" not in kind)).astype(kind) for kind in kinds}
    signals = [Signal(RAW, T, name=name, conversion=dict(rule), unit=f"u {name}") for name, rule in CONVERSIONS.items()]
    signals += [Signal(values, T, name=f"number {kind}") for kind, values in numbers.items()]
    signals.append(Signal(np.array([b"abc"] * 400), T, name="text", encoding="latin-1"))
    slow = [Signal(np.arange(4.0), T[::100], name="slow", unit="m/s")]
    path = save(tmp_path / "a.mf4", (signals, "fast"), (slow, "slow"), version=version, compression=compression)
    with open_log(path) as log:
        assert list(log.columns) == [*CONVERSIONS, *(f"number {kind}" for kind in kinds), "slow"]
        assert log.columns["slow"].unit == "m/s"
        assert log.columns["linear"].unit == "u linear"
        assert log.columns["linear"].clock != log.columns["slow"].clock
        found = read(log)
        for name, expected in EXPECTED.items():
            np.testing.assert_allclose(found[name][1], expected, rtol=1e-15)
            np.testing.assert_array_equal(found[name][0], T)
        for kind, values in numbers.items():
            np.testing.assert_array_equal(found[f"number {kind}"][1], values.astype(float))
        np.testing.assert_array_equal(found["slow"][0], T[::100])
        assert log.notes == []


def test_ranges_and_texts(tmp_path: Path) -> None:
    """The upper edge of a range belongs to integers only; a text among scaled values is missing."""
    signals = [Signal(RAW.astype(kind), T, name=kind, conversion=RANGES | {"default": -1.0}) for kind in ("u1", "f4")]
    rule = {"lower_0": 155, "upper_0": 160, "text_0": b"not available", "default_addr": SCALE}
    signals.append(Signal(RAW, T, name="text", conversion=rule))
    with open_log(save(tmp_path / "a.mf4", (signals, "g"))) as log:
        found = read(log)
    for kind, first, second in (("u1", RAW <= 40, RAW <= 80), ("f4", RAW < 40, RAW < 80)):
        expected = np.where(first, 1.0, np.where((RAW >= 60) & second, 2.0, -1.0))
        np.testing.assert_array_equal(found[kind][1], expected)
    np.testing.assert_array_equal(found["text"][1], np.where(RAW >= 155, np.nan, RAW * 0.5 - 10))
    with MDF(tmp_path / "a.mf4") as alone:
        np.testing.assert_array_equal(found["f4"][1], alone.get("f4").samples)


@pytest.mark.parametrize("columns", [False, True])
def test_invalid_samples_are_missing(tmp_path: Path, columns: bool) -> None:
    bad = np.arange(400) % 3 == 0
    signals = [
        Signal(np.arange(400.0), T, name="a", invalidation_bits=bad),
        Signal(np.arange(400.0), T, name="b", invalidation_bits=~bad),
    ]
    version = "4.20" if columns else "4.10"
    with open_log(save(tmp_path / "a.mf4", (signals, "g"), version=version, column_storage=columns)) as log:
        found = read(log)
    np.testing.assert_array_equal(found["a"][1], np.where(bad, np.nan, np.arange(400.0)))
    np.testing.assert_array_equal(found["b"][1], np.where(bad, np.arange(400.0), np.nan))
    np.testing.assert_array_equal(found["a"][0], T)


@pytest.mark.parametrize("version", ["3.30", "4.10"])
def test_chunks_are_bounded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, version: str) -> None:
    """Of groups with a common name, and a time that does not rise."""
    stamps = np.r_[T[:-2], T[-3], T[-1]]
    groups = ([Signal(T, T, name="a"), Signal(-T, T, name="b")], ""), ([Signal(T + 1, stamps, name="a")], "imu")
    monkeypatch.setattr(mdf, "_FRAGMENT", 150 * 24)
    with open_log(save(tmp_path / "a.mf4", *groups, version=version)) as log:
        a, b, other = log.columns
        assert version == "3.30" or (a, b, other) == ("a@0", "b", "a@imu")
        chunks = list(log.chunks([a, b]))
        assert [chunk.values["b"].size for chunk in chunks] == [150, 150, 100]
        assert [list(chunk.values) for chunk in chunks] == [[a, b]] * 3
        assert [chunk.done for chunk in chunks] == [0.375, 0.75, 1.0]
        done = [chunk.done for chunk in log.chunks(log.columns)]
        assert done == sorted(done)
        for name, expected in ((a, T), (b, -T), (other, np.delete(T + 1, -2))):
            np.testing.assert_array_equal(read(log, name)[name][1], expected)
        (note,) = log.notes
        assert note.startswith("1 sample of ")
        with pytest.raises(SignalError, match="several sources"):
            log.find("a")
        with pytest.raises(SignalError, match="no column 'speed'"):
            list(log.chunks(["speed"]))


def can_frames(count: int = 200) -> Any:
    """VDC2 of J1939 from source 0B on bus 1, with a yaw rate that rises, as asammdf wants a bus log."""
    payload = np.full((count, 8), 0xFF, np.uint8)
    raw = (np.arange(count) * 8 + 32000).astype("<u2")
    payload[:, 3:5] = raw.view(np.uint8).reshape(-1, 2)
    fields = [
        np.full(count, 1, "u1"),
        np.full(count, 0x18F0090B, "<u4"),
        np.ones(count, "u1"),
        np.full(count, 8, "u1"),
        np.full(count, 8, "u1"),
        payload,
    ]
    names = [f"CAN_DataFrame.{n}" for n in ("BusChannel", "ID", "IDE", "DLC", "DataLength", "DataBytes")]
    types = [(n, f.dtype, f.shape[1:]) for n, f in zip(names, fields, strict=True)]
    samples = np.rec.fromarrays(fields, dtype=types)
    source = Source(source_type=Source.SOURCE_BUS, bus_type=Source.BUS_TYPE_CAN, name="CAN", path="CAN", comment="")
    return Signal(samples, np.arange(count) / 100, name="CAN_DataFrame", source=source), raw * 2.0**-13 - 3.92


def test_bus_logging(tmp_path: Path) -> None:
    frames, yaw_rate = can_frames()
    path = save(tmp_path / "a.mf4", ([frames], "CAN"), ([Signal(T, T, name="yaw_rate", unit="deg/s")], "imu"))
    told: list[float] = []
    with open_log(path, progress=told.append) as log:
        assert told[-1] == 1.0
        assert not [name for name in log.columns if "DataFrame" in name]
        assert log.columns["VDC2.yaw_rate@0B"].unit == "rad/s"
        found = read(log, "VDC2.yaw_rate@0B", "yaw_rate")
        np.testing.assert_allclose(found["VDC2.yaw_rate@0B"][1], yaw_rate, atol=1e-12)
        np.testing.assert_array_equal(found["VDC2.yaw_rate@0B"][0], np.arange(200) / 100)
        np.testing.assert_array_equal(found["yaw_rate"][1], T)


def test_frames_that_no_database_has_are_worth_a_note(tmp_path: Path) -> None:
    frames, _ = can_frames()
    frames.samples["CAN_DataFrame.ID"] = 0x18FF010B
    with pytest.raises(SignalError, match="no database has any of their ids"):
        open_log(save(tmp_path / "a.mf4", ([frames], "CAN")))
    both = save(tmp_path / "b.mf4", ([frames], "CAN"), ([Signal(T, T, name="yaw_rate")], "imu"))
    with open_log(both) as log:
        assert list(log.columns) == ["yaw_rate"]
        assert "no database has any of their ids" in log.notes[0]
    with pytest.raises(SignalError, match=r"none\.dbc"):
        open_log(both, databases=[tmp_path / "none.dbc"])
    with pytest.raises(SignalError, match="1 channels but not one sample; copy it again"):
        open_log(save(tmp_path / "c.mf4", ([Signal(T[:0], T[:0], name="a")], "g")))


@pytest.mark.slow
def test_a_damaged_block_costs_the_samples_from_there_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    random = np.random.default_rng(0).normal(size=300_000)
    signals = [Signal(random, np.arange(300_000) / 100, name="a")]
    path = save(tmp_path / "a.mf4", (signals, "g"), ([Signal(T, T, name="b")], "h"), compression=1)
    data = bytearray(path.read_bytes())
    assert data.count(b"##DZ") > 2
    data[data.rindex(b"##DZ", 0, data.rindex(b"##DZ")) + 5000] ^= 0xFF  # of the long group
    path.write_bytes(data)
    with open_isolated_log(path) as log:
        found = read(log)
        count = found["a"][1].size
        assert 0 < count < 300_000
        np.testing.assert_array_equal(found["a"][1], random[:count])
        assert log.notes[0].startswith(f"broken after {count} samples of group 'g', at {(count - 1) / 100:.1f} s: ")
        np.testing.assert_array_equal(found["b"][1], T)


def database(ids: Any) -> str:
    return 'VERSION ""\nBU_: X\n' + "".join(
        f'BO_ {k} M{k}: 8 X\n SG_ a : 0|8@1+ (1,0) [0|0] "" X\n SG_ b : 8|16@1+ (1,0) [0|0] "" X\n' for k in ids
    )


@pytest.mark.parametrize("name", ["canedge_virtual_channels.MF4", "canedge_older_firmware.MF4"])
def test_can_loggers_beside_asammdf_alone(data: Path, tmp_path: Path, monkeypatch: Any, name: str) -> None:
    """Also those whose BusChannel, IDE and Dir are virtual channels."""
    path = data / "vendor" / name
    times: dict[tuple[int, int], list[Any]] = {}
    with MDF(path) as alone:
        for k, group in enumerate(alone.groups):
            if "CAN_DataFrame.ID" not in [c.name for c in group.channels] or not group.channel_group.cycles_nr:
                continue
            names = ("BusChannel", "ID", "DataLength", "DataBytes")
            parts = [alone.get(f"CAN_DataFrame.{part}", group=k) for part in names]
            rows = zip(parts[0].timestamps, *(part.samples for part in parts), strict=True)
            for at, bus, number, size, payload in rows:
                times.setdefault((int(bus), int(number)), []).append((at, size, *payload[:3]))
    (tmp_path / "a.dbc").write_text(database({number for _, number in times}))
    monkeypatch.setattr(mdf, "_FRAGMENT", 2000)
    with open_log(path, databases=[tmp_path / "a.dbc"]) as log:
        found = read(log)
        assert log.notes == []
    assert len(found) == 2 * len(times)
    several = {number for _, number in times if len({b for b, n in times if n == number}) > 1}
    for (bus, number), frames in times.items():
        at, size, low, middle, high = np.array(sorted(frames), float).T
        suffix = f"@:{bus}" if number in several else ""
        np.testing.assert_array_equal(found[f"M{number}.a{suffix}"], [at, np.where(size > 0, low, np.nan)])
        expected = np.where(size > 2, middle + 256 * high, np.nan)
        np.testing.assert_array_equal(found[f"M{number}.b{suffix}"], [at, expected])


def test_an_unsorted_file_beside_asammdf_alone(data: Path) -> None:
    path = data / "vendor" / "canape_demo_unsorted.mf4"
    with open_isolated_log(path) as log, MDF(path, raise_on_multiple_occurrences=False) as alone:
        found = read(log)
        assert len(found) == 24
        for name, (time, values) in found.items():
            signal = alone.get(name)
            if signal.samples.dtype.kind not in "biuf":  # names of states
                signal = alone.get(name, raw=True)
            np.testing.assert_array_equal(time, signal.timestamps)
            np.testing.assert_array_equal(values, signal.samples.astype(float))


@pytest.mark.parametrize(
    ("version", "compression", "layout"),
    [("3.30", 0, {}), ("4.10", 0, {}), ("4.10", 2, {}), ("4.20", 1, {"column_storage": True})],
)
def test_a_sample_of_a_large_file_is_spread_over_each_group(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, version: str, compression: int, layout: Any
) -> None:
    fast, slow = np.arange(20_000) / 1000, np.arange(2000) / 100
    signals = [Signal(np.arange(20_000) * 0.5, fast, name="r"), Signal(np.arange(20_000, dtype="i4"), fast, name="n")]
    path = save(
        tmp_path / "run.mf4", (signals, "imu"), ([Signal(3 * slow, slow, name="v")], "abs"),
        version=version, compression=compression, **layout,
    )  # fmt: skip
    monkeypatch.setattr(source, "_LARGE", 1e3)
    monkeypatch.setattr(source, "_PART", 10.0)
    monkeypatch.setattr(mdf, "_FRAGMENT", 1000)
    with open_log(path) as log:
        whole = {name: values for name, (_, values) in read(log).items()}
        log.sample()
        assert log.sampled
        found = read(log)
        assert [note[:42] for note in log.notes] == ["a sample of 0 of 0 MB was read, in 8 parts"]
    for name, rate in (("r", 1000), ("n", 1000), ("v", 100)):
        time, values = found[name]
        numbers = np.rint(time * rate).astype(int)
        np.testing.assert_array_equal(values, whole[name][numbers])
        assert (numbers[0], numbers[-1]) == (0, whole[name].size - 1)
        assert (np.diff(numbers) > 1).sum() == 7
        assert numbers.size == pytest.approx(0.08 * whole[name].size, rel=0.05)


X = np.linspace(0.0, 2.0, 100)


def test_arithmetic_is_evaluated() -> None:
    """With floats: integers do not overflow, and a tower of powers ends."""
    for formula, expected in {
        "3*X1 + sin(X1)": 3 * X + np.sin(X),
        "-(X - 2)**2 / 1e1": -((X - 2) ** 2) / 10,
        "pow(X, 3) + abs(-X) + log10(X + 1)": X**3 + X + np.log10(X + 1),
        "P2 * X": 5 * X,
    }.items():
        assert evaluate(formula, {"X": X, "X1": X, "P2": 5.0}) == pytest.approx(expected)
    assert evaluate("X**2", {"X": np.array([200], np.uint8)}) == [40000.0]
    assert evaluate("9**9**9**9", {}) == np.inf


def test_anything_else_is_refused() -> None:
    for formula in [
        "__import__('os').getpid() + X", "f'{X}'", "X.size", "[X]", "(lambda: X)()", "open('/etc/passwd')", "Y",
        "X and X", "sin(X, out=X)", "sin(*X)", "1j*X", "True*X", "'a'*9", "X if X else X", "(" * 300 + "X", "1" * 900,
        "X+" * MAX_FORMULA + "X", "", "\0",
    ]:  # fmt: skip
        with pytest.raises(ValueError, match="formula"):
            evaluate(formula, {"X": X})


ESCAPE = (
    'X+0*len(f\'{[c for c in ().__class__.__base__.__subclasses__() if c.__name__=="catch_warnings"][0]()'
    '._module.__builtins__["open"]("NAME","w")}\')'
)
"""The check of numexpr ignores what is between single quotes."""


@pytest.mark.parametrize("version", ["3.30", "4.10"])
@pytest.mark.parametrize("formula", ["X*0+len(str(open('NAME','w')))", ESCAPE])
def test_a_formula_in_a_file_runs_no_code(tmp_path: Path, version: str, formula: str) -> None:
    witness = tmp_path / "written"
    formula = formula.replace("X", "X1" if version < "4" else "X").replace("NAME", str(witness))
    signals = [Signal(X, T[:100], name="speed", conversion={"formula": formula}), Signal(X, T[:100], name="other")]
    with open_isolated_log(save(tmp_path / "log.mf4", (signals, "g"), version=version)) as log:
        assert not list(log.chunks(["speed"]))
        assert "formula" in log.notes[0]
        assert sum(chunk.values["other"].size for chunk in log.chunks(["other"])) == X.size
    assert not witness.exists()
