"""Workbooks: .xlsx by openpyxl, .xls by xlwt, .ods as its XML; the sheet is read like a text table."""

import datetime
import zipfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any
from xml.sax.saxutils import escape

import numpy as np
import pytest

from fifthwheel.base.errors import SignalError
from fifthwheel.data.logs.row_time import find_row_time

pytest.importorskip("python_calamine")

from fifthwheel.data.logs import read_log
from fifthwheel.data.logs.readers import child
from fifthwheel.data.logs.readers import open_log as open_any
from fifthwheel.data.logs.readers.workbook import open_log

Rows = Sequence[Sequence[Any]]
TABLE: Rows = [
    ["Messung 17", None, None, None],
    [None, None, None, None],
    ["Zeit", "speed", "yaw_rate.tractor", 'a;b\t"c"'],
    ["s", "km/h", "[deg/s]", None],
    *([k / 100, 36 + k, None if k == 3 else -k / 3, "x"] for k in range(50)),
]


def xlsx(path: Path, sheets: dict[str, Rows]) -> Path:
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook()
    book.remove(book.active)
    for name, rows in sheets.items():
        sheet = book.create_sheet(name)
        for row in rows:
            sheet.append(list(row))
    book.save(path)
    return path


def xls(path: Path, sheets: dict[str, Rows]) -> Path:
    xlwt = pytest.importorskip("xlwt")
    book = xlwt.Workbook()
    for name, rows in sheets.items():
        sheet = book.add_sheet(name)
        for i, row in enumerate(rows):
            for k, cell in enumerate(row):
                if cell is not None:
                    sheet.write(i, k, cell)
    book.save(str(path))
    return path


ODS = "application/vnd.oasis.opendocument.spreadsheet"
MANIFEST = "urn:oasis:names:tc:opendocument:xmlns:manifest:1.0"


def ods(path: Path, sheets: dict[str, Rows]) -> Path:
    def cell(value: Any) -> str:
        if value is None:
            return "<table:table-cell/>"
        if isinstance(value, str):
            return f'<table:table-cell office:value-type="string"><text:p>{escape(value)}</text:p></table:table-cell>'
        return f'<table:table-cell office:value-type="float" office:value="{value!r}"/>'

    names = ("office", "table", "text")
    spaces = " ".join(f'xmlns:{name}="urn:oasis:names:tc:opendocument:xmlns:{name}:1.0"' for name in names)
    body = "".join(
        f'<table:table table:name="{name}">'
        + "".join(f"<table:table-row>{''.join(map(cell, row))}</table:table-row>" for row in rows)
        + "</table:table>"
        for name, rows in sheets.items()
    )
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file:
        file.writestr("mimetype", ODS, zipfile.ZIP_STORED)
        file.writestr(
            "content.xml",
            f'<?xml version="1.0"?><office:document-content {spaces}><office:body><office:spreadsheet>{body}'
            "</office:spreadsheet></office:body></office:document-content>",
        )
        file.writestr(
            "META-INF/manifest.xml",
            f'<?xml version="1.0"?><manifest:manifest xmlns:manifest="{MANIFEST}">'
            f'<manifest:file-entry manifest:full-path="/" manifest:media-type="{ODS}"/>'
            "</manifest:manifest>",
        )
    return path


@pytest.mark.parametrize("write", [xlsx, xls, ods])
def test_the_first_sheet_with_a_table(tmp_path: Path, write: Any) -> None:
    path = write(tmp_path / "run.x", {"Cover": [["A test"], ["of a truck"]], "Data": TABLE, "More": TABLE})
    with open_any(path) as log:
        assert {name: column.unit for name, column in log.columns.items()} == {
            "Zeit": "s",
            "speed": "km/h",
            "yaw_rate.tractor": "deg/s",
            "a;b 'c'": None,
        }
        assert find_row_time(log) == "Zeit"
        assert log.notes == ["1 comment line above the header", "sheet 'Data' is read, and not 'Cover', 'More'"]
    record = read_log(path)
    assert record.name == "run"
    np.testing.assert_array_equal(record.time, np.arange(50) / 100)
    np.testing.assert_allclose(record.signals["speed"], 10 + np.arange(50) / 3.6, rtol=1e-15)
    assert np.flatnonzero(np.isnan(record.signals["yaw_rate.tractor"])).tolist() == [3]


def test_dates_and_times_of_day_are_time(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    start = datetime.datetime(2024, 5, 6, 7, 8, 9)
    rows = [
        [start + datetime.timedelta(milliseconds=10 * k), (start + datetime.timedelta(seconds=k)).time(), k, k % 2 == 0]
        for k in range(20)
    ]
    with open_log(xlsx(tmp_path / "a.xlsx", {"S": [["when", "of day", "v", "on"], *rows]})) as log:
        chunks = list(log.chunks(list(log.columns)))
        found = {name: np.concatenate([chunk.values[name] for chunk in chunks]) for name in log.columns}
        assert [log.columns[name].unit for name in log.columns] == ["s", "s", None, None]
    np.testing.assert_allclose(found["when"], start.replace(tzinfo=datetime.UTC).timestamp() + 0.01 * np.arange(20))
    np.testing.assert_allclose(found["of day"], 7 * 3600 + 8 * 60 + 9 + np.arange(20))
    np.testing.assert_array_equal(found["on"], np.arange(20) % 2 == 0)


@pytest.mark.parametrize("write", [xlsx, xls, ods])
def test_what_is_no_workbook_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, write: Any) -> None:
    """One that is cut, an archive, one without a table; the text that was written of it is removed."""
    (tmp_path / "texts").mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "texts"))
    path = write(tmp_path / "a.x", {"S": TABLE})
    with open_any(path):
        assert list((tmp_path / "texts").glob("*/*/a.x"))
    path.write_bytes(path.read_bytes()[: path.stat().st_size * 2 // 3])
    words = write(tmp_path / "b.x", {"S": [["only words"]]})
    with zipfile.ZipFile(tmp_path / "c.xlsx", "w") as file:
        file.writestr("run.csv", "t,v\n0,1\n")
    for wrong, error in (
        (path, r"^a\.x: cannot be read as Excel or OpenDocument .*copy it again"),
        (words, r"^b\.x: no sheet with a table; sheet 'S': not a table"),
        (tmp_path / "c.xlsx", r"c\.xlsx: a zip archive; unpack it"),
    ):
        with pytest.raises(SignalError, match=error):
            open_any(wrong)
    assert not list((tmp_path / "texts").iterdir())


@pytest.mark.slow
def test_a_sheet_that_expands_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two cells far apart, which stand for a table of all between them."""
    monkeypatch.setenv(child.MEMORY, "400")
    monkeypatch.setenv(child.SECONDS, "20")
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook()
    book.active["A1"], book.active["XFD1048576"] = 1, 2
    book.save(tmp_path / "a.xlsx")
    with pytest.raises(SignalError, match=r"^a\.xlsx: "):
        open_any(tmp_path / "a.xlsx")
