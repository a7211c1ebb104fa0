"""A page in one file: its scripts, the images of its figures, and what happens when it cannot be written."""

import json
import sys

import numpy as np
import pytest

from fifthwheel.base.errors import FifthwheelError
from fifthwheel.base.pages import Document, html
from fifthwheel.base.plots.items import range_without_spikes


def test_a_library_is_compressed_once(tmp_path, monkeypatch):
    monkeypatch.setenv("FIFTHWHEEL_CACHE", str(tmp_path / "cache"))
    first = html._plotly.__wrapped__()
    monkeypatch.setattr(html, "compressed", lambda data: pytest.fail("compressed again"))
    assert html._plotly.__wrapped__() == first


def test_an_error_leaves_the_old_page(tmp_path, monkeypatch):
    path = tmp_path / "report.html"
    path.write_text("old")
    monkeypatch.setattr("pathlib.Path.replace", lambda *_: (_ for _ in ()).throw(OSError("full")))
    with pytest.raises(OSError, match="full"):
        html.write(path, Document("t", []))
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_json_cannot_leave_its_script():
    text = html.script_json({"name": "</script><!--\u2028&"})
    assert not set(text) & set("<>&\u2028")
    assert json.loads(text) == {"name": "</script><!--\u2028&"}
    with pytest.raises(ValueError, match="JSON"):
        html.script_json([float("nan")])


@pytest.mark.parametrize(
    ("name", "expected"), [("a/b\\c:d", "a_b_c_d"), ("...", "_"), ("../up", "_up"), ("yaw_rate.tractor",) * 2]
)
def test_file_names(name, expected):
    assert html.file_name(name) == expected


def test_formats_that_cannot_be_written_are_refused(monkeypatch):
    with pytest.raises(FifthwheelError, match="figures: expected svg, png, pdf"):
        html.checked_format("gif")
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(FifthwheelError, match=r"pip install 'fifthwheel\[figures\]'"):
        html.checked_format("svg")


def test_a_spike_does_not_flatten_a_small_line():
    time = np.linspace(0, 10, 200)
    values = np.sin(time)
    values[50] = 1e3

    def rows(line):
        return len({point.split(",")[1] for point in line.split('d="M')[1].split('"')[0].split("L")})

    assert rows(html.course(time, values)) < 5
    assert rows(html.course(time, values, range_without_spikes(values))) > 50
