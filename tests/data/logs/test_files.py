import codecs
from dataclasses import replace

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from fifthwheel.base.errors import SignalError
from fifthwheel.data.checks.samples import without_spikes
from fifthwheel.data.logs import SignalMap, read_log, write_record
from fifthwheel.data.record import Record

NAMES = ("speed", "steer.tractor.front", "yaw_rate.semitrailer", "load_transfer.semitrailer", "articulation.dolly-2")
GOOD = """\
time,speed [km/h],yaw_rate.tractor [deg/s],reference.sideslip.semitrailer,note
0.0,36,1,0.1,a
0.1,72,,0.2,b
0.2,36,3,0.3,c
"""


def read_content(tmp_path, content, name="log.csv", **options):
    path = tmp_path / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return read_log(path, **options)


@st.composite
def records(draw):
    size = draw(st.integers(2, 30))
    steps = draw(st.lists(st.floats(1e-3, 10), min_size=size, max_size=size))
    values = st.lists(st.floats(-1e9, 1e9) | st.just(np.nan), min_size=size, max_size=size)
    parts = [draw(st.dictionaries(st.sampled_from(NAMES), values, min_size=k)) for k in (1, 0)]
    return Record(time=np.cumsum(steps), signals=parts[0], reference=parts[1])


@pytest.mark.slow
@settings(max_examples=10, deadline=None)
@given(record=records(), suffix=st.sampled_from([".csv", ".parquet"]))
def test_a_written_record_is_read_equal(tmp_path_factory, suffix, record):
    assume(all(without_spikes(part) is part for part in (record, replace(record, signals=record.reference))))
    path = tmp_path_factory.mktemp("trip") / f"run{suffix}"
    write_record(record, path)
    back = read_log(path, SignalMap.parse("[time]\nrate = inf"))
    assert back == record
    assert list(back.signals) == list(record.signals)
    assert (back.name, back.notes) == ("run", ())
    assert [file.name for file in path.parent.iterdir()] == [path.name]


GERMAN = GOOD.replace(",", ";").replace(".0;", ",0;").replace("0.", "0,")


DIALECTS = [
    GERMAN,
    GOOD.replace(",", "\t"),
    GOOD.replace("\n", "\r\n"),
    GOOD.replace("\n", "\r"),
    "# made by hand\n\n# twice\n" + GOOD.replace("0.1,72", "# in between\n0.1,72"),
    GOOD.replace("deg/s", "°/s"),
    GOOD.replace("deg/s", "°/s").encode("latin-1"),
    codecs.BOM_UTF8 + GOOD.encode(),
    GOOD.encode("utf-16"),
    codecs.BOM_UTF16_BE + GOOD.encode("utf-16-be"),
    GOOD.replace("time,", '"t [ms]",').replace("0.1,72", "100,72").replace("0.2,36", "+200,36"),
    GOOD.replace("72,,", "72, NaN ,"),
    "# " + GOOD.replace(",note", "").replace(",a", "").replace(",b", "").replace(",c", "").replace(",,", ",nan,"),
]


@pytest.mark.slow
def test_dialects_of_csv(tmp_path):
    good = read_content(tmp_path, GOOD)
    assert good.signals["speed"] == pytest.approx([10, 20, 10])
    assert good.signals["yaw_rate.tractor"] == pytest.approx([np.pi / 180, np.nan, np.pi / 60], nan_ok=True)
    assert good.reference["sideslip.semitrailer"] == pytest.approx([0.1, 0.2, 0.3])
    for content in DIALECTS:
        assert read_content(tmp_path, content) == good, content


def test_text_cells_are_missing_and_noted(tmp_path):
    record = read_content(tmp_path, GOOD.replace("0.1,72", "0.1,fault"))
    assert np.isnan(record.signals["speed"][1])
    assert record.notes == ("1 cells of column 'speed' are no numbers, such as 'fault': taken as missing",)
    with pytest.raises(SignalError, match=r"column 'speed' is mostly text \(2 of 3 cells, such as 'fast'\)"):
        read_content(tmp_path, GOOD.replace("36", "fast"))


def test_incomplete_lines_and_lines_without_time_are_left_out_and_noted(tmp_path):
    record = read_content(tmp_path, GOOD + "0.3,36\n,36,3,0.3,c\n0.4,36,3,0.3,c")
    assert len(record) == 3
    assert len(record.notes) == 3


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "empty, 0 bytes"),
        ("\n# only this\n\n", "empty, not a single line"),
        ("time,speed\n", "a header but no rows"),
        ("time,speed", "a header but no rows"),
        ("Dear Sir\nthe log\nis attached\n", "not a table"),
        (bytes(range(256)) * 4, "not a table, it holds binary data"),
        (b"PAR1 and then nothing", "cut short or damaged"),
        ("1,2\n3,4\n5,6\n", "begins with numbers"),
        ("time,v\n0,1\n1,2\n", r'no column has the name of a signal, the columns are time, v; map'),
        ("stamp,speed\n0,1\n1,2\n", "speed has no timestamps: the log has no column named 'time' or 't'"),
        ("t,speed,speed\n0,1,1\n1,2,2\n", "column 'speed' has several sources; say which: speed@1, speed@2"),
        ("t,speed\n0,1\n1,2\n0.5,3\n", r"goes back from 1 s to 0\.5 s at row 3"),
        ("t,speed [deg]\n0,1\n1,2\n", "got 'deg'"),
        ("t,speed\n12:00,1\n12:01,2\n", "column 't' is mostly text"),
        ("t,speed\n0,1\n1,inf\n", "speed: infinite"),
    ],
)  # fmt: skip
def test_files_without_a_usable_log_are_refused(tmp_path, content, message):
    with pytest.raises(SignalError, match=message):
        read_content(tmp_path, content)


def test_missing_files_and_unknown_formats(tmp_path, weaving):
    for path in (tmp_path / "none.csv", tmp_path):
        with pytest.raises(SignalError, match="cannot be read"):
            read_log(path)
    with pytest.raises(SignalError, match=r"end the name in \.csv or \.parquet"):
        write_record(weaving, tmp_path / "run.xlsx")
    with pytest.raises(SignalError, match="cannot be written"):
        write_record(weaving, tmp_path / "no" / "run.csv")


def test_parquet_of_other_writers(tmp_path):
    units = [
        pa.field("t", pa.int32(), metadata={"unit": "ms"}),
        pa.field("speed", pa.float32(), metadata={"unit": "km/h"}),
    ]
    columns = [pa.array([0, 100, 200], pa.int32()), pa.array([36, None, 72], pa.float32())]
    columns += [pa.array(["1", "2", "x"]).dictionary_encode(), pa.array([[1], [2], [3]])]
    fields = [*units, pa.field("roll.tractor", columns[2].type), pa.field("yaw.tractor", columns[3].type)]
    pq.write_table(pa.table(columns[:3], schema=pa.schema(fields[:3])), tmp_path / "a")
    record = read_log(tmp_path / "a", name="a run")
    assert record.time == pytest.approx([0, 0.1, 0.2])
    assert record.signals["speed"] == pytest.approx([10, np.nan, 20], nan_ok=True)
    assert record.signals["roll.tractor"] == pytest.approx([1, 2, np.nan], nan_ok=True)
    assert record.name == "a run"
    pq.write_table(pa.table(columns, schema=pa.schema(fields)), tmp_path / "b")
    with pytest.raises(SignalError, match="holds list"):
        read_log(tmp_path / "b")
    assert len(read_log(tmp_path / "b", SignalMap.parse('ignore = ["yaw.tractor"]'))) == 3


def test_windows_are_in_seconds_whatever_the_unit_of_the_time(tmp_path):
    """The unit of the map, where the header has none."""
    path = tmp_path / "log.csv"
    path.write_text("stamp,v\n" + "".join(f"{100 * k},20\n" for k in range(61)))
    signal_map = SignalMap.parse('[time]\ncolumn = "stamp"\nunit = "ms"\n[signals]\nspeed = "v"\n')
    record = read_log(path, signal_map, exclude=[(2.0, 4.0)])
    assert record.time[-1] == pytest.approx(6.0)
    assert not ((record.time >= 2.0) & (record.time <= 4.0)).any()
