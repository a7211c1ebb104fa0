"""Plots over the time of a log, in a browser: one cursor with values, and one zoom on all pages."""

import re
from pathlib import Path

import pytest

from fifthwheel.apps.app.workspace import Workspace
from tests.apps.app.served import chromium, served, tab
from tests.apps.app.test_way import prepared
from tests.results.report.conftest import result

__all__ = ["result"]

pytestmark = pytest.mark.slow

LOG = Path(__file__).parents[3] / "examples" / "lane_changes.csv"
RANGES = """[...document.querySelectorAll('.fw-time')].filter(e => e._fullLayout)
  .map(e => e._fullLayout.xaxis.range.map(x => Math.round(x)))"""


@pytest.fixture(scope="module")
def browser():
    with chromium() as started:
        yield started


def test_one_cursor_shows_values_and_the_zoom_is_kept_between_pages(browser, tmp_path):
    folder = Workspace(tmp_path / "w").folder
    (folder / "logs" / "lane.csv").write_bytes(LOG.read_bytes())
    with served(folder) as address, tab(browser, address) as page:
        page.get_by_role("table", name="Channels").wait_for()
        page.get_by_label("From, s").fill("3")
        page.get_by_label("To, s").fill("9")
        page.get_by_role("button", name="Show", exact=True).click()
        page.wait_for_function(f"JSON.stringify({RANGES}) == '[[3,9]]'")
        panel = page.locator(".fw-time .nsewdrag").first.bounding_box()
        page.mouse.move(panel["x"] + panel["width"] / 2, panel["y"] + 30)
        values = page.locator(".fw-values > div")
        values.first.wait_for()
        assert values.count() == 4
        assert values.first.inner_text().startswith("6 s")

        page.get_by_role("link", name="2 Signals").click()
        page.get_by_text("The prediction explains").first.wait_for(timeout=60_000)
        page.wait_for_function(f"({RANGES}).length > 3 && ({RANGES}).every(x => x[0] == 3 && x[1] == 9)")
        panel = page.locator(".fw-time .nsewdrag").nth(1).bounding_box()
        page.mouse.move(panel["x"] + panel["width"] / 2, panel["y"] + 30)
        page.wait_for_function("[...document.querySelectorAll('.fw-cursor')].filter(e => !e.hidden).length > 3")


def test_signals_are_found_by_name_and_a_finding_is_beside_its_plot(browser, tmp_path):
    folder = Workspace(tmp_path / "w").folder
    (folder / "logs" / "lane.csv").write_bytes(LOG.read_bytes())
    signals = '[signals]\nspeed = "speed"\n"steer.tractor.front" = "steer.tractor.front"\n'
    trailer = '[signals."yaw_rate.semitrailer"]\ncolumn = "yaw_rate.semitrailer"\nsign = -1\n'
    (folder / "signals.toml").write_text(f'{signals}"yaw_rate.tractor" = "yaw_rate.tractor"\n{trailer}')
    with served(folder) as address, tab(browser, address) as page:
        page.get_by_role("table", name="Channels").wait_for()
        page.get_by_role("link", name="2 Signals").click()
        section = page.get_by_role("region", name="yaw_rate.semitrailer", exact=True)
        section.locator(".fw-finding").get_by_role("img", name="error").wait_for(timeout=60_000)
        page.get_by_label("Find a signal").fill("semi")
        page.get_by_role("region", name="speed", exact=True).wait_for(state="hidden")
        assert section.is_visible()


def test_a_time_column_without_the_name_of_a_time_is_chosen(browser, tmp_path):
    folder = Workspace(tmp_path / "w").folder
    first, rest = LOG.read_text().split("\n", 1)
    assert first.startswith("time")
    (folder / "logs" / "lane.csv").write_text(f"{first.replace('time', 'run', 1)}\n{rest}".replace("run [s]", "run"))
    with served(folder) as address, tab(browser, address) as page:
        page.get_by_text("No column has the name of a time.").wait_for(timeout=60_000)
        page.get_by_label("Time column of lane.csv").click()
        page.get_by_role("option", name="run", exact=True).click()
        page.get_by_text("17.0 s, 13 channels").wait_for(timeout=60_000)
        page.get_by_role("link", name="2 Signals").click()
        page.get_by_text("The prediction explains").first.wait_for(timeout=60_000)
    assert '[time]\ncolumn = "run"' in (folder / "signals.toml").read_text()


def test_the_plotted_signals_of_explore_and_compare_are_found_by_name(browser, tmp_path, result):
    folder = prepared(tmp_path / "w", count=1).folder
    for name in ("a", "b"):
        result.identification.save(folder / "runs" / name)
    with served(folder) as address, tab(browser, f"{address}explore") as page:
        for name, what in (("explore", "signals"), ("compare", "run.csv")):
            page.goto(f"{address}{name}")
            plot = page.get_by_role("img", name=re.compile(f"Measured and predicted,? {what}"))
            plot.get_by_text("Tractor, yaw rate").first.wait_for(timeout=60_000)
            page.get_by_label("Find a signal").fill("trailer")
            plot.get_by_text("Tractor, yaw rate").first.wait_for(state="detached")
            plot.get_by_text("Trailer, yaw rate").first.wait_for()
            page.get_by_label("Find a signal").fill("none")
            page.get_by_text("No signal has this name.").wait_for()
