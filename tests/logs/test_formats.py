"""One drive in every format: the same record, the same parameters; and damage that never surprises."""

import contextlib
import random
import warnings

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fifthwheel.errors import SignalError
from fifthwheel.identify import OneStage, identify
from fifthwheel.logs import Record, SignalMap, read
from fifthwheel.logs.draft import as_toml
from fifthwheel.logs.propose import propose
from fifthwheel.logs.readers import open_log
from fifthwheel.logs.survey import survey
from fifthwheel.simulate import simulate
from fifthwheel.vehicle import get

from .formats import FORMATS, stored

TRUCK = get("cheng_cebon_2011")


@pytest.fixture(scope="module")
def drive():
    record = simulate(TRUCK, count=1, seed=1)
    return Record(time=record.time, signals=record.signals, name="drive")


@pytest.fixture(scope="module")
def found(drive):
    return identify([drive], TRUCK, OneStage())


@pytest.mark.parametrize("name", FORMATS)
def test_the_same_drive_is_the_same_truck(tmp_path, drive, found, name):
    path, signal_map = stored(drive, tmp_path, name)
    path = path.rename(tmp_path / "no_ending")  # content tells the format
    record = read(path, signal_map, name="drive")
    assert set(record.signals) == set(drive.signals)
    assert len(record) == len(drive)
    shift = record.time[0] - drive.time[0]
    assert record.time - shift == pytest.approx(drive.time, abs=1.1e-4 if name == "drive.trc" else 2e-6)
    for signal, values in drive.signals.items():
        assert record.signals[signal] == pytest.approx(values, rel=1e-6, abs=1e-7)
    again = identify([record], TRUCK, OneStage())
    for one, other in zip(found.parameters, again.parameters, strict=True):
        assert other.verdict == one.verdict
        assert other.value == pytest.approx(one.value, abs=(0.1 if name == "drive.trc" else 0.01) * one.sigma)
        assert other.sigma == pytest.approx(one.sigma, rel=0.01)


@pytest.mark.parametrize("name", FORMATS)
def test_every_format_is_listed_and_has_a_proposal(tmp_path, drive, name):
    path, signal_map = stored(drive, tmp_path, name)
    with open_log(path, signal_map.databases) as log:
        told = survey(log)
        proposal = propose(log, told, databases=signal_map.databases)
    record = read(path, SignalMap.parse(as_toml(proposal, told)))
    assert set(drive.signals) <= {*record.signals, *record.reference}


@pytest.mark.parametrize("name", FORMATS)
def test_damage_never_surprises(tmp_path, drive, name):
    """Cut anywhere or with flipped bits: a record, or an error of ours that names the file."""
    path, signal_map = stored(drive.cut(0, 2), tmp_path, name)
    whole, rng = path.read_bytes(), random.Random(name)
    records = 0
    for k in range(40):
        data = bytearray(whole)
        if k % 2:
            data = data[: rng.randrange(len(data))]
        else:
            for _ in range(rng.choice([1, 3, 30])):
                data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
        path.write_bytes(data)
        with warnings.catch_warnings(), contextlib.suppress(SignalError):
            warnings.simplefilter("error")
            record = read(path, signal_map)
            records += 1
            assert all(np.isfinite(values[np.isfinite(values)]).all() for values in record.signals.values())
        with contextlib.suppress(SignalError), open_log(path, signal_map.databases) as log:
            survey(log)
    if name not in ("drive.parquet", "drive.mf4", "v73.mat"):  # of these the end holds what the beginning means
        assert records > 5


HEADS = [
    b"", b"PAR1", b"MDF     4.10    x", b"UnFinMF 4.10", b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM",
    b"MATLAB 7.3 MAT-file".ljust(512) + b"\x89HDF\r\n\x1a\n", b"\x89HDF\r\n\x1a\n", b"\x89MCAP0\r\n", b"LOGG\x90\0\0\0",
    b"date Sat Nov 21\nbase hex  timestamps absolute\n", b";$FILEVERSION=2.0\n;$COLUMNS=N,O,T,I,d,l,D\n",
    b"(1.0) can0 18F0090B#00", b"t;v\n0;1\n", b"PK\x03\x04", b"\x1f\x8b\x08",
]  # fmt: skip


@settings(max_examples=300, deadline=None)
@given(
    head=st.sampled_from(HEADS),
    data=st.binary(max_size=300) | st.text("0123456789.,;:#()[] \ncanrxtd-+eE", max_size=300).map(str.encode),
)
def test_anything_at_all_is_a_record_or_our_error(tmp_path_factory, head, data):
    path = tmp_path_factory.mktemp("any") / "x"
    path.write_bytes(head + data)
    with contextlib.suppress(SignalError):
        assert isinstance(read(path), Record)
    with contextlib.suppress(SignalError), open_log(path) as log:
        propose(log, survey(log))


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", ["drive.csv", "drive.mf4", "v5.mat", "drive.mcap", "drive.asc", "drive.blf", "candump.log"]
)
def test_a_damaged_log_gives_no_wrong_truck(tmp_path, drive, name):
    """With flipped bits: the truck within its sigma, a verdict that says no, or an error of ours; checked or not."""
    path, signal_map = stored(drive, tmp_path, name)
    whole, rng, identified = path.read_bytes(), random.Random(name), 0
    truth = TRUCK.parameters()
    for k in range(12):
        data = bytearray(whole)
        for _ in range(rng.choice([1, 10, 40])):
            data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
        path.write_bytes(data)
        with contextlib.suppress(SignalError):
            found = identify([read(path, signal_map)], TRUCK, OneStage(check=k % 2 == 0))
            identified += 1
            assert all(np.isfinite([e.value, e.sigma]).all() for e in found.parameters)
            told = [e for e in found.parameters if e.verdict == "converged"]
            assert all(abs(e.value - truth[e.name]) < 5 * e.sigma for e in told)
    assert identified or name == "drive.blf"  # one packed container is all or nothing
