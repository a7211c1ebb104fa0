"""The page in a real browser without a head: it draws everything, asks no network, fits a telephone, and prints."""

import json
import re
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

import pytest

from fifthwheel.report import write_report

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(CHROMIUM is None, reason="no chromium on the PATH"),
]
FLAGS = [
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--enable-logging=stderr",
    "--virtual-time-budget=60000",
]

PROBE = """
<script>
addEventListener("load", async () => {
  const rest = (ms) => new Promise((done) => setTimeout(done, ms));
  const told = {};
  for (let k = 0; k < 600 && !document.body.dataset.drawn; k++) await rest(50);
  const places = () => [...document.querySelectorAll(".plot")];
  const open = places().filter((p) => !p.closest("details"));
  told.drawn = open.every((p) => p.querySelector("svg.main-svg"));
  told.waiting = places().some((p) => p.closest("details") && !p.dataset.drawn);
  told.width = document.documentElement.scrollWidth;
  told.window = innerWidth;
  told.wide = [...document.querySelectorAll(".scroll")].filter((s) => s.scrollWidth > s.clientWidth).length;
  document.querySelectorAll("details").forEach((d) => { d.open = true; });
  await rest(1500);
  told.folded = places().every((p) => p.querySelector("svg.main-svg"));
  told.open = document.documentElement.scrollWidth;
  const tall = places().filter((p) => p.classList.contains("tall"));
  const range = (p) => p._fullLayout.xaxis.range.map((v) => Math.round(100 * v) / 100);
  const before = range(tall[1]);
  await Plotly.relayout(tall[0], { "xaxis.range[0]": 3, "xaxis.range[1]": 5 });
  await rest(300);
  told.zoomed = range(tall[1]);
  tall[0].emit("plotly_doubleclick");
  await rest(500);
  told.whole = JSON.stringify(range(tall[1])) === JSON.stringify(before);
  const loaded = performance.getEntriesByType("resource").map((entry) => entry.name);
  told.network = loaded.filter((name) => !/^(data|blob):/.test(name));
  parent.document.title = JSON.stringify(told);
  document.title = JSON.stringify(told);
});
</script>
"""


@dataclass(frozen=True)
class Seen:
    """What a browser said of a page."""

    told: dict
    errors: list[str]


def browse(profile: Path, *arguments: str) -> subprocess.CompletedProcess:
    command = [str(CHROMIUM), *FLAGS, f"--user-data-dir={profile}", *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=180, check=True)


@pytest.fixture(scope="module")
def report(found, tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("browser") / "report.html"
    write_report(path, found.identification, found.records, found.states, title="my <truck> & co")
    return path


def look(report: Path, width: int) -> Seen:
    """Open a copy that tells about itself, in a frame: a window without a head is never narrower than 500."""
    folder = report.parent
    text = report.read_text(encoding="utf-8")
    (folder / "probe.html").write_text(text.replace("</head>", PROBE + "</head>"), encoding="utf-8")
    frame = f'<title>-</title><iframe src="probe.html" style="width:{width}px;height:900px;border:0"></iframe>'
    (folder / "frame.html").write_text(frame, encoding="utf-8")
    ran = browse(
        folder / "profile",
        "--allow-file-access-from-files",
        f"--window-size={max(width, 500) + 50},1000",
        "--dump-dom",
        (folder / "frame.html").as_uri(),
    )
    title = re.search("<title>(.*?)</title>", ran.stdout)
    assert title, ran.stdout[:500]
    errors = [line for line in ran.stderr.splitlines() if "CONSOLE" in line]
    return Seen(told=json.loads(title[1].replace("&quot;", '"').replace("&amp;", "&")), errors=errors)


@pytest.mark.parametrize("width", [390, 1400])
def test_the_page_in_a_browser(report, width):
    seen = look(report, width)
    told = seen.told
    assert seen.errors == []
    assert told["drawn"], "a plot that is not folded away was not drawn"
    assert told["waiting"], "folded plots are drawn when they are opened, not before"
    assert told["folded"], "a plot that was opened was not drawn"
    assert told["network"] == []
    assert told["window"] == width
    assert told["width"] <= width
    assert told["open"] <= width
    assert told["wide"] == 0, "a table has to be scrolled sideways"
    assert told["zoomed"] == [3, 5], "the plots of a log zoom together"
    assert told["whole"], "a double click shows all again"


def test_it_prints(report):
    pdf = report.with_name("report.pdf")
    browse(report.parent / "profile", "--no-pdf-header-footer", f"--print-to-pdf={pdf}", report.as_uri())
    data = pdf.read_bytes()
    assert data.startswith(b"%PDF")
    pages = len(re.findall(rb"/Type\s*/Page\b", data))
    assert 8 <= pages <= 40
    assert len(data) > 2e5, "the plots are not in it"
