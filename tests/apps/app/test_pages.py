"""The pages in a browser."""

import re
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from fifthwheel.apps.app.workspace import Workspace
from fifthwheel.data.logs import SignalMap, write_record
from fifthwheel.model.simulate import simulate
from fifthwheel.truck import get
from tests.apps.app.served import chromium, served, tab
from tests.apps.app.test_way import prepared
from tests.results.report.conftest import result

pytestmark = pytest.mark.slow

EXAMPLES = Path(__file__).parents[3] / "examples"
TRUCK = get("cheng_cebon_2011")
TRAILER = "yaw_rate.semitrailer"


@pytest.fixture(scope="module")
def browser():
    with chromium() as started:
        yield started


@contextmanager
def opened(browser, folder, *files, **size):
    """The first page of a new workspace with dropped files, the first of which is read."""
    with served(folder) as address, tab(browser, address, **size) as page:
        drop(page, *files)
        yield page


def drop(page, *files):
    """Drop files, the first of which is read; none is called refused, and the list of the uploader is empty again."""
    page.set_input_files("input[type=file]", [str(file) for file in files])
    page.get_by_text(re.compile(r"\d+ channels")).first.wait_for()
    assert page.get_by_text("Refused").count() == 0
    page.locator(".q-uploader__file").first.wait_for(state="detached")


def signals(page):
    """Go to the page Signals, and wait for its evidence."""
    page.get_by_role("link", name="2 Signals").click()
    page.get_by_text("The prediction explains").first.wait_for(timeout=60_000)


def section(page, signal):
    return page.get_by_role("region", name=signal, exact=True)


def explained(page, signal):
    """Percentage that the prediction explains, when it is no longer computed."""
    page.get_by_role("status", name="Computing").wait_for(state="hidden")
    text = section(page, signal).get_by_text("The prediction explains").inner_text()
    return float(re.search(r"explains ([\d.]+)", text)[1])


def mapped(folder):
    return SignalMap.load(folder / "signals.toml").signals


def example(folder):
    return EXAMPLES / "lane_changes.csv"


def test_an_inverted_sign_is_found_and_mended(browser, tmp_path):
    with opened(browser, tmp_path / "w", example(tmp_path)) as page:
        signals(page)
        section(page, TRAILER).get_by_role("button", name="−", exact=True).click()
        page.get_by_role("button", name=f"Mend {TRAILER}").wait_for()
        assert explained(page, TRAILER) < 10
        assert mapped(tmp_path / "w")[TRAILER].sign == -1
        page.get_by_role("button", name=f"Mend {TRAILER}").click()
        page.get_by_text("Nothing speaks against the map.").wait_for()
        assert explained(page, TRAILER) > 95
    assert mapped(tmp_path / "w")[TRAILER].sign == 1


def test_a_clock_offset_is_found_and_mended_by_one_click(browser, tmp_path):
    record = simulate(TRUCK, count=2, seed=1)
    values = np.interp(record.time - 0.35, record.time, record.signals[TRAILER])
    write_record(record.with_signals({TRAILER: values}), tmp_path / "late.csv")
    folder = tmp_path / "w"
    folder.mkdir()
    (folder / "vehicle.toml").write_text(TRUCK.to_toml())
    (folder / "signals.toml").write_text(f'[signals]\nspeed = "speed"\n"{TRAILER}" = "{TRAILER}"\n')
    with opened(browser, folder, tmp_path / "late.csv") as page:
        signals(page)
        assert explained(page, TRAILER) < 80
        page.get_by_role("button", name=re.compile(f"Correct the delay of {TRAILER} by 0.3")).click()
        section(page, TRAILER).get_by_text(re.compile("explains (9[5-9]|100)")).wait_for()
        assert explained(page, TRAILER) > 95
    assert mapped(tmp_path / "w")[TRAILER].delay == pytest.approx(0.35, abs=0.05)


def test_a_reload_loses_nothing_and_changes_are_undone_by_keys(browser, tmp_path):
    with opened(browser, tmp_path / "w", example(tmp_path)) as page:
        signals(page)
        field = section(page, TRAILER).get_by_label(f"Delay of {TRAILER}", exact=True)
        field.fill("0.2")
        page.get_by_role("button", name=re.compile(f"Undo: {TRAILER}: delay 0.2")).wait_for()
        page.reload()
        section(page, TRAILER).get_by_label(f"Delay of {TRAILER}", exact=True).wait_for()
        assert section(page, TRAILER).get_by_label(f"Delay of {TRAILER}", exact=True).input_value() == "0.2"
        page.get_by_role("button", name="Propose a map").focus()
        page.keyboard.press("Control+z")
        page.get_by_role("button", name=re.compile(f"Redo: {TRAILER}")).wait_for()
        assert mapped(tmp_path / "w")[TRAILER].delay == 0.0
        page.locator("#main").focus()
        page.keyboard.press("Control+y")
        page.get_by_role("button", name=re.compile(f"Undo: {TRAILER}")).wait_for()
    assert mapped(tmp_path / "w")[TRAILER].delay == 0.2


def test_a_decimal_comma_is_a_decimal_point(browser, tmp_path):
    with opened(browser, tmp_path / "w", example(tmp_path)) as page:
        signals(page)
        field = section(page, TRAILER).get_by_label(f"Gain of {TRAILER}", exact=True)
        field.press("ControlOrMeta+a")
        field.press_sequentially("0,054")
        page.get_by_role("button", name=re.compile(f"Undo: {TRAILER}: gain 0.054")).wait_for()
        too_large = re.compile(r"The prediction is (18|19) times too large")
        section(page, TRAILER).get_by_text(too_large).wait_for(timeout=60_000)
        page.get_by_role("listitem").get_by_text(too_large).wait_for()
        assert page.get_by_text("Nothing speaks against the map.").count() == 0
        field.press("Tab")
        page.wait_for_timeout(300)
        assert field.input_value() == "0.054"
        field.fill("1.234,5")
        page.get_by_text("expected a number without separators of thousands").wait_for()
        delay = section(page, TRAILER).get_by_label(f"Delay of {TRAILER}", exact=True)
        delay.fill("-3566")
        page.get_by_text("expected at most 60 s, got -3566 s").first.wait_for()
        delay.press("Tab")
        page.wait_for_function("document.querySelector('[aria-label=\"Delay of yaw_rate.semitrailer\"]').value == '0'")
    assert (mapped(tmp_path / "w")[TRAILER].gain, mapped(tmp_path / "w")[TRAILER].delay) == (0.054, 0.0)


def test_a_field_shows_the_file_after_a_refusal_which_stays_until_the_next_change(browser, tmp_path):
    with opened(browser, tmp_path / "w", example(tmp_path)) as page:
        signals(page)
        before = mapped(tmp_path / "w")
        row = section(page, TRAILER)
        unit, column = (row.get_by_label(f"{key} of {TRAILER}", exact=True) for key in ("Unit", "Column"))
        kept = unit.input_value()
        unit.fill("kg")
        unit.press("Tab")
        row.get_by_role("alert").get_by_text("kg").wait_for()
        assert unit.input_value() == kept
        column.fill("yaw_rate.tractor")
        page.get_by_role("option", name="yaw_rate.tractor", exact=True).click()
        row.get_by_role("alert").get_by_text("yaw_rate.tractor").wait_for()
        page.wait_for_timeout(1000)
        assert column.input_value() == TRAILER
        assert mapped(tmp_path / "w") == before
        row.get_by_role("button", name="−", exact=True).click()
        row.get_by_role("alert").wait_for(state="hidden")


def test_a_log_that_cannot_be_read_is_not_used(browser, tmp_path):
    broken = tmp_path / "broken.csv"
    broken.write_bytes(b"\x00\x01" * 5000)
    with served(tmp_path / "w") as address, tab(browser, address) as page:
        page.set_input_files("input[type=file]", str(broken))
        page.get_by_role("alert").filter(has_text="broken.csv").wait_for()
        page.get_by_role("button", name="Undo: leave out broken.csv").wait_for()
        assert not page.get_by_label("Use broken.csv").is_checked()
    assert not Workspace(tmp_path / "w").choices().of("broken.csv").use


def test_a_second_tab_shows_the_change_of_the_first(browser, tmp_path):
    with opened(browser, tmp_path / "w", example(tmp_path)) as page:
        signals(page)
        with tab(browser, page.url) as other:
            # the second tab of another session of the browser is a tab like any other
            other.get_by_label(f"Delay of {TRAILER}", exact=True).wait_for()
            section(page, TRAILER).get_by_label(f"Delay of {TRAILER}", exact=True).fill("0.1")
            other.get_by_role("button", name=re.compile(f"Undo: {TRAILER}: delay 0.1")).wait_for()
            assert other.get_by_label(f"Delay of {TRAILER}", exact=True).input_value() == "0.1"
            other.get_by_label(f"Gain of {TRAILER}", exact=True).fill("2")
            page.get_by_role("button", name=re.compile(f"Undo: {TRAILER}: gain 2")).wait_for()
    channel = mapped(tmp_path / "w")[TRAILER]
    assert (channel.delay, channel.gain) == (0.1, 2.0)


def test_windows_are_excluded_by_mouse_and_by_keyboard(browser, tmp_path):
    with opened(browser, tmp_path / "w", example(tmp_path)) as page:
        page.get_by_role("button", name="Select", exact=True).click()
        page.wait_for_timeout(1000)
        panel = page.locator("[role=img] .nsewdrag").first.bounding_box()
        low, high = panel["x"] + 0.25 * panel["width"], panel["x"] + 0.5 * panel["width"]
        page.mouse.move(low, panel["y"] + 20)
        page.mouse.down()
        page.mouse.move(high, panel["y"] + 40, steps=8)
        page.mouse.up()
        page.wait_for_timeout(1000)
        assert float(page.get_by_label("From, s").input_value()) == pytest.approx(0.25 * 17, abs=0.3)
        page.get_by_role("button", name="Exclude", exact=True).click()
        page.get_by_text("excluded: 4.").wait_for()
        page.get_by_label("From, s").fill("12")
        page.get_by_label("To, s").fill("13.5")
        page.get_by_label("To, s").press("Tab")
        for _ in range(3):
            page.keyboard.press("Tab")
        page.keyboard.press("Shift+Tab")
        assert page.evaluate("document.activeElement.innerText").strip() == "Exclude"
        page.keyboard.press("Enter")
        page.get_by_text("excluded: 12.00 to 13.50 s").wait_for()
        page.reload()
        page.get_by_text("excluded: 12.00 to 13.50 s").wait_for()
    text = (tmp_path / "w" / "workspace.toml").read_text()
    assert "12.0" in text
    assert "13.5" in text


def test_names_from_files_are_text(browser, tmp_path):
    evil = "<img src=x onerror=alert(1)>"
    folder = tmp_path / "<b>evil<b>"
    folder.mkdir()
    log = folder / f"{evil}.csv"
    lines = [f"time [s],{evil} [{evil}],<script>alert(2)</script>", *(f"{k / 10},{k % 7},{k % 3}" for k in range(200))]
    log.write_text("\n".join(lines))
    with opened(browser, tmp_path / "w", log) as page:
        page.on("dialog", lambda dialog: pytest.fail(f"a script ran: {dialog.message}"))
        page.get_by_text(evil).first.wait_for()
        page.wait_for_timeout(1500)
        page.get_by_role("link", name="2 Signals").click()
        page.wait_for_timeout(3000)
        assert page.locator("img[src=x]").count() == 0
        assert page.locator("#main script").count() == 0


def test_a_file_that_is_too_large_or_no_log_is_refused(browser, tmp_path):
    large, broken = tmp_path / "large.csv", tmp_path / "broken.csv"
    large.write_text("time,x\n" + "1,2\n" * 400_000)
    broken.write_bytes(b"\x00\x01" * 5000)
    with served(tmp_path / "w", "--max-file", "0.001") as address, tab(browser, address, faults=False) as page:
        page.set_input_files("input[type=file]", str(large))
        page.get_by_text("Refused: too large").wait_for()
        page.set_input_files("input[type=file]", str(broken))
        page.get_by_role("alert").filter(has_text="broken.csv").wait_for()
    assert [path.name for path in (tmp_path / "w" / "logs").iterdir()] == ["broken.csv"]


@pytest.mark.parametrize("width", [390, 1400])
def test_no_page_is_wider_than_the_window_and_every_control_has_a_label(browser, tmp_path, width):
    with opened(browser, tmp_path / "w", example(tmp_path), width=width) as page:
        for name in ("1 Log", "2 Signals"):
            page.get_by_role("link", name=name).click()
            page.wait_for_timeout(2500)
            assert page.evaluate("document.documentElement.scrollWidth") <= width
            assert page.evaluate(UNLABELLED) == []


UNLABELLED = """[...document.querySelectorAll('#main button, #main input, #main [role=checkbox], #main a')]
  .filter(e => e.offsetParent && !e.closest('.modebar') && !(e.innerText || '').trim()
    && !e.getAttribute('aria-label') && !e.labels?.length && !e.closest('label')
    && !e.closest('[aria-label]') && !e.getAttribute('title'))
  .map(e => e.outerHTML.slice(0, 200))"""


LOG = Path(__file__).parents[3] / "examples" / "lane_changes.csv"

INSIDE = """[...document.querySelectorAll('.fw-nav a')].map(e => e.getBoundingClientRect())
  .every(box => box.left >= 0 && box.right <= innerWidth && box.bottom > box.top)"""


def test_the_bar_names_the_workspace_and_fits_a_telephone(browser, tmp_path):
    folder = Workspace(tmp_path / "bend <b>").folder
    with served(folder) as address, tab(browser, address, width=390) as page:
        page.get_by_text("bend <b>", exact=True).wait_for()
        assert page.title() == "Log - bend <b> - fifthwheel"
        assert page.get_by_role("navigation", name="Pages").get_by_role("link").count() == 8
        assert page.evaluate(INSIDE)


def test_the_theme_follows_the_system_until_another_is_chosen(browser, tmp_path):
    dark = "document.body.classList.contains('body--dark')"
    with served(tmp_path / "w") as address, tab(browser, address) as page:
        page.wait_for_function(f"!{dark}")
        page.emulate_media(color_scheme="dark")
        page.wait_for_function(dark)
        page.get_by_role("button", name="Theme: system").click()
        page.wait_for_function(f"!{dark}")
        page.get_by_role("button", name="Theme: light").click()
        page.emulate_media(color_scheme="light")
        page.wait_for_function(dark)
        page.goto(f"{address}truck")
        page.get_by_role("button", name="Theme: dark").wait_for()
        page.wait_for_function(dark)


def test_the_tables_of_a_log_are_not_cut_on_a_telephone(browser, tmp_path):
    folder = Workspace(tmp_path / "w").folder
    (folder / "logs" / "lane.csv").write_bytes(LOG.read_bytes())
    cut = "[...document.querySelectorAll('.fw-scroll')].filter(e => e.scrollWidth > e.clientWidth).length"
    with served(folder) as address, tab(browser, address, width=390) as page:
        page.get_by_role("table", name="Channels").wait_for()
        assert page.evaluate(cut) == 0


@pytest.mark.parametrize(("page_name", "next_page"), [("check", "Truck"), ("signals", "Log"), ("compare", "Identify")])
def test_an_empty_page_leads_to_the_next_step(browser, tmp_path, page_name, next_page):
    folder = Workspace(tmp_path / "w").folder
    (folder / "logs" / "lane.csv").write_bytes(LOG.read_bytes())
    with served(folder) as address, tab(browser, f"{address}{page_name}") as page:
        page.get_by_role("link", name=f"To the page {next_page}").click()
        page.get_by_role("heading", name=next_page, level=1).wait_for()


__all__ = ["result"]

RANGES = """[...document.querySelectorAll('.fw-time')].filter(e => e._fullLayout)
  .map(e => e._fullLayout.xaxis.range.map(x => Math.round(x)))"""


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
