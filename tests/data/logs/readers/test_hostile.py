"""Hostile files: small files that expand, that block, or that have names and headers of any length."""

import contextlib
import io
import struct
import time
import warnings
import zlib
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from asammdf import MDF, Signal
from scipy.io import savemat

from fifthwheel.base.errors import SignalError
from fifthwheel.data.channels import split_header
from fifthwheel.data.logs import read_log, write_record
from fifthwheel.data.logs.map_text import as_toml
from fifthwheel.data.logs.propose import propose_map
from fifthwheel.data.logs.readers import child, open_log
from fifthwheel.data.logs.signal_map import SignalMap
from fifthwheel.data.logs.survey import survey_log
from fifthwheel.data.record import Record

EXPANDED = 500_000_000
"""Bytes, more than the limit of memory."""


@pytest.fixture
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    """Limits that are reached at once."""
    monkeypatch.setenv(child.SAMPLES, "10")
    monkeypatch.setenv(child.MEMORY, "400")
    monkeypatch.setenv(child.SECONDS, "60")


def deflated(head: bytes) -> bytes:
    """A zlib stream of a head and EXPANDED zeros."""
    compressor, zeros = zlib.compressobj(1), bytes(1 << 20)
    parts = [compressor.compress(head), *(compressor.compress(zeros) for _ in range(EXPANDED >> 20))]
    return b"".join([*parts, compressor.flush()])


def parquet_of_text(path: Path) -> None:
    """One long text in every row, stored once."""
    texts = pa.DictionaryArray.from_arrays(pa.array(np.zeros(4000, np.int32)), pa.array(["x" * 500_000]))
    plain = pa.schema([("time", pa.float64()), ("speed", pa.large_string())])
    table = pa.table({"time": np.arange(4000.0), "speed": texts})
    with pq.ParquetWriter(path, plain, use_dictionary=True) as writer:
        for first in range(0, 4000, 400):
            writer.write_table(table.slice(first, 400).cast(plain), row_group_size=4000)


def mat5(path: Path) -> None:
    """A variable of zeros."""
    buffer = io.BytesIO()
    savemat(buffer, {"t": np.zeros(1000)})
    head, element = buffer.getvalue()[:128], bytearray(buffer.getvalue()[128:-8000])
    element[4:8] = struct.pack("<I", len(element) - 8 + EXPANDED)
    element[-4:] = struct.pack("<I", EXPANDED)
    packed = deflated(bytes(element))
    path.write_bytes(head + struct.pack("<II", 15, len(packed)) + packed)


def mdf(path: Path) -> None:
    """A deflated block of zeros."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        file = MDF(version="4.10")
        file.append([Signal(np.zeros(5000), np.arange(5000) / 100, name="speed", unit="m/s")])
        file.save(path, overwrite=True, compression=1)
        file.close()
    content = path.read_bytes()
    at, packed = content.index(b"##DZ"), deflated(b"")
    block = struct.pack("<4sIQQ2sBBIQQ", b"##DZ", 0, 48 + len(packed), 0, b"DT", 0, 0, 0, EXPANDED, len(packed))
    content += bytes(-len(content) % 8)
    assert content.count(struct.pack("<Q", at)) == 1
    path.write_bytes(content.replace(struct.pack("<Q", at), struct.pack("<Q", len(content))) + block + packed)


@pytest.mark.slow
@pytest.mark.usefixtures("small")
@pytest.mark.parametrize("write", [parquet_of_text, mat5, mdf])
def test_a_small_file_that_expands_is_refused(tmp_path: Path, write: Callable[[Path], None]) -> None:
    path = tmp_path / "bomb.mf4"
    write(path)
    assert path.stat().st_size < 10e6
    with pytest.raises(SignalError, match=r"^bomb\.mf4: .*(more than \d+ MB|crashed)"):
        surveyed(path)


def surveyed(path: Path) -> tuple[list[str], str]:
    """Notes and proposed map of a log."""
    with open_log(path) as log:
        survey = survey_log(log)
        return list(survey.notes), as_toml(propose_map(log, survey), survey)


def test_a_chain_of_compressions_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """HDF5 compresses the same zeros twice: 4 MB in a few hundred bytes."""
    monkeypatch.setenv(child.SAMPLES, "1")
    rows = 300_000
    with h5py.File(tmp_path / "a.mat", "w") as file:
        file["t"] = np.arange(rows, dtype="f4")
        for k in range(3):
            chain = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
            chain.set_chunk((rows // 3,))
            for _ in range(2):
                chain.set_deflate(9)
            space = h5py.h5s.create_simple((rows,))
            data = h5py.h5d.create(file.id, f"a{k}".encode(), h5py.h5t.IEEE_F64LE, space, chain)
            data.write(h5py.h5s.ALL, h5py.h5s.ALL, np.zeros(rows))
    monkeypatch.setattr(child, "_EXPANSION", 1)
    with pytest.raises(SignalError, match=r"a\.mat: its samples need more than \d+ MB; map fewer columns"):
        surveyed(tmp_path / "a.mat")


def test_a_long_header_is_refused_by_its_length(tmp_path: Path) -> None:
    path = tmp_path / "wide.csv"
    for columns, line in ((40_000, 1), (40_000, 3), (9_000, 1)):
        names = ",".join(["time", *(f"column_{k}" for k in range(columns))])
        path.write_text("\n" * (line - 1) + names + "\n" + ("0" + ",1" * columns + "\n") * 3)
        if columns < 10_000:
            with open_log(path) as log:
                assert len(log.columns) == columns + 1
            continue
        with pytest.raises(SignalError, match=r"wide\.csv: a line of \d+ kB or more, at most 131 kB expected"):
            open_log(path)


def test_a_long_header_of_a_column_is_split_at_once() -> None:
    for text in ("a" + " " * 100_000 + "b", "(" * 100_000, "a" + " (" * 50_000 + ")", "[" * 99_999 + "]"):
        start = time.process_time()
        split_header(text)
        assert time.process_time() - start < 0.2


HOSTILE = "x\x1b]0;title\x07\n[signals]\ndatabases = ['/etc/passwd']\u202e\x7f"


def test_names_do_not_write_into_a_proposed_map(tmp_path: Path) -> None:
    """A name of a column, a unit and a name of a file with line ends and control characters."""
    path = tmp_path / f"run {HOSTILE.replace('/', '')}.parquet"
    names = ["time", "speed \x7f", "Gier\u202erate", f"yaw_rate {HOSTILE} [deg/s]", f"axle load {HOSTILE} [kN]"]
    table = pa.table([np.arange(100.0) / 10, *np.random.default_rng(0).normal(size=(4, 100))], names=names)
    pq.write_table(table, path)
    notes, text = surveyed(path)
    proposed = SignalMap.parse(text)
    assert not proposed.databases
    assert proposed.signals["speed"].column == "speed \x7f"
    assert proposed.signals["yaw_rate.tractor"].column in ("Gier\u202erate", f"yaw_rate {HOSTILE}".replace("\n", " "))
    assert "etc" in text
    assert all(c.isprintable() or c == "\n" for c in "".join([text, *notes]))
    assert read_log(path, SignalMap.parse(text)).name.isprintable()


@pytest.mark.usefixtures("small")
def test_a_small_limit_of_memory_is_sufficient(tmp_path: Path) -> None:
    """What the libraries reserve and do not use is within the limit."""
    for name in ("log.csv", "log.parquet"):
        write_record(Record(time=np.arange(50.0), signals={"speed": np.arange(50.0)}), tmp_path / name)
        assert len(read_log(tmp_path / name)) == 50


@pytest.mark.slow
@pytest.mark.parametrize("column", [0, 1])
def test_extreme_times_and_values_give_no_warning(tmp_path: Path, column: int) -> None:
    for extreme in ("inf", "1e308", "5e-324"):
        rows = [[f"{k / 1000:g}", "10"] for k in range(2000)]
        for k in range(500, 700):
            rows[k][column] = extreme if k % 2 else f"-{extreme}"
        (tmp_path / "log.csv").write_text("time,speed\n" + "".join(",".join(row) + "\n" for row in rows))
        for unit in ("s", "h"):
            with contextlib.suppress(SignalError):
                read_log(tmp_path / "log.csv", SignalMap.parse(f"[time]\nunit = '{unit}'"))
        surveyed(tmp_path / "log.csv")
