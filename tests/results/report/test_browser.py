"""The page in headless Chromium: it draws every plot, uses no network, fits a narrow or dark screen, and prints."""

import json
import re
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

import pytest

from fifthwheel.results.report import write_report

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
]
TIME = "--virtual-time-budget=60000"
"""Of a page that waits for its own scripts."""
DARK = "--blink-settings=preferredColorScheme=0"

PROBE = r"""
<script>
addEventListener("load", async () => {
  const wait = (ms) => new Promise((done) => setTimeout(done, ms));
  const state = {};
  state.synchronous = document.body.dataset.drawn === "yes";
  const plots = () => [...document.querySelectorAll("div.plot")];
  const open = plots().filter((p) => !p.closest("details"));
  state.drawn = open.every((p) => p.querySelector("svg.main-svg"));
  state.waiting = plots().some((p) => p.closest("details") && !p.dataset.drawn);
  state.width = document.documentElement.scrollWidth;
  state.window = innerWidth;
  state.appendix = document.getElementById("appendix").getBoundingClientRect().top + scrollY;
  const luminance = (colour) => colour.match(/[\d.]+/g).slice(0, 3).reduce((sum, part) => sum + part / 765, 0);
  state.page = luminance(getComputedStyle(document.body).backgroundColor);
  const styles = (selector) => [...document.querySelectorAll(selector)].map((element) => getComputedStyle(element));
  state.words = styles("div.plot text, svg.truck text").map((style) => luminance(style.fill));
  state.behind = styles("div.plot svg.main-svg").map((style) => style.backgroundColor);
  state.legends = document.querySelectorAll("main .trace-legend").length;
  const wide = [...document.querySelectorAll("main div.plot.wide")];
  const [fit, , main] = wide;  // of the first log
  fit.emit("plotly_hover", { xvals: [4] });
  state.cursors = wide.map((p) => !p.cursor.hidden);
  const keys = [...document.querySelectorAll("main .trace-legend button")];
  keys.find((key) => key.textContent.trim() === "measured").click();
  await wait(300);
  state.hidden = wide.flatMap((p) => p.data).filter((trace) => trace.name === "measured").map((trace) => trace.visible);
  state.wide = [...document.querySelectorAll(".scroll")].filter((s) => s.scrollWidth > s.clientWidth).length;
  document.querySelectorAll("details").forEach((d) => { d.open = true; });
  await wait(1500);
  state.folded = plots().every((p) => p.querySelector("svg.main-svg"));
  state.open = document.documentElement.scrollWidth;
  const range = (p) => p._fullLayout.xaxis.range.map((v) => Math.round(100 * v) / 100);
  const before = range(main);
  await Plotly.relayout(fit, { "xaxis.range[0]": 3, "xaxis.range[1]": 5 });
  await wait(300);
  state.zoomed = range(main);
  fit.emit("plotly_doubleclick");
  await wait(500);
  state.reset = JSON.stringify(range(main)) === JSON.stringify(before);
  const loaded = performance.getEntriesByType("resource").map((entry) => entry.name);
  state.network = loaded.filter((name) => !/^(data|blob):/.test(name));
  parent.document.title = JSON.stringify(state);
  document.title = JSON.stringify(state);
});
</script>
"""


@dataclass(frozen=True)
class Observation:
    """What the probe measured, and the errors on the console."""

    state: dict
    errors: list[str]


def browse(profile: Path, *arguments: str) -> subprocess.CompletedProcess:
    command = [str(CHROMIUM), *FLAGS, f"--user-data-dir={profile}", *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=180, check=True)


@pytest.fixture(scope="module")
def report(result, tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("browser") / "report.html"
    write_report(path, result.identification, result.records, result.states, title="my <truck> & co")
    return path


def open_pages(pages: list[Path], width: int, *flags: str, probe: str = PROBE) -> Observation:
    """Open copies with a probe in frames, because a headless window is at least 500 px wide."""
    folder, frames = pages[0].parent, "<title>-</title>"
    for page in pages:
        text = page.read_text(encoding="utf-8")
        (folder / f"probe_{page.name}").write_text(text.replace("</head>", probe + "</head>"), encoding="utf-8")
        frames += f'<iframe src="probe_{page.name}" style="width:{width}px;height:900px;border:0"></iframe>'
    (folder / "frame.html").write_text(frames, encoding="utf-8")
    ran = browse(
        folder / "profile",
        "--allow-file-access-from-files",
        TIME,
        *flags,
        f"--window-size={max(width, 500) + 50},1000",
        "--dump-dom",
        (folder / "frame.html").as_uri(),
    )
    title = re.search("<title>(.*?)</title>", ran.stdout)
    assert title, ran.stdout[:500]
    errors = [line for line in ran.stderr.splitlines() if "CONSOLE" in line]
    return Observation(state=json.loads(title[1].replace("&quot;", '"').replace("&amp;", "&")), errors=errors)


@pytest.mark.parametrize(("width", "dark"), [(390, True), (1400, False)])
def test_the_page_in_a_browser(report, width, dark):
    observation = open_pages([report], width, *[DARK] * dark)
    state = observation.state
    assert observation.errors == []
    assert state["synchronous"], "a page that is printed at once would have no plots"
    assert state["drawn"], "a plot that is not folded away was not drawn"
    assert state["waiting"], "folded plots are drawn when they are opened, not before"
    assert state["folded"], "a plot that was opened was not drawn"
    assert state["network"] == []
    assert state["window"] == width
    assert state["width"] <= width
    assert state["open"] <= width
    assert state["wide"] == 0, "a table has to be scrolled sideways"
    assert state["appendix"] <= 5000 or width < 1400
    assert state["legends"] == 1
    assert state["cursors"] == [True, False, True, False], "one cursor for all plots of a log"
    assert state["hidden"] == [False] * len(state["hidden"]) != [], "a key of the legend hides its line everywhere"
    assert state["zoomed"] == [3, 5], "the plots of a log zoom together"
    assert state["reset"], "a double click shows all again"
    assert (state["page"] < 0.2) is dark
    assert all(abs(words - state["page"]) > 0.45 for words in state["words"]), "a text cannot be read"
    assert set(state["behind"]) == {"rgba(0, 0, 0, 0)"}


def test_it_prints_at_once_with_the_appendix(report):
    pdf = report.with_name("report.pdf")
    browse(report.parent / "profile", DARK, "--no-pdf-header-footer", f"--print-to-pdf={pdf}", report.as_uri())
    data = pdf.read_bytes()
    assert data.startswith(b"%PDF")
    assert 8 <= len(re.findall(rb"/Type\s*/Page\b", data)) <= 40
    assert len(data) > 1e5, "the plots are not in it"
