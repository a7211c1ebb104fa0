"""The pages in a browser."""

import re
from pathlib import Path

import pytest

from fifthwheel.apps.app.workspace import Workspace
from fifthwheel.data.logs import SignalMap
from tests.apps.app.served import served, tab, watched

pytestmark = pytest.mark.slow

LOG = Path(__file__).parents[3] / "examples" / "lane_changes.csv"
TRAILER = "yaw_rate.semitrailer"


@pytest.fixture(scope="module")
def started(browser, tmp_path_factory):
    """A workspace with the dropped example and its proposed map, and a tab of it: all that many tests need."""
    folder = tmp_path_factory.mktemp("example") / "bend <b>"
    with served(folder) as address, tab(browser, address) as page:
        drop(page, LOG)
        page.get_by_role("link", name="2 Signals").click()
        wait_for_evidence(page)
        yield folder, page, (folder / "signals.toml").read_text()


@pytest.fixture
def folder(started, emptied):
    """The workspace as it was after the drop."""
    (emptied / "signals.toml").write_text(started[2])
    return emptied


def drop(page, *files):
    """Drop files, the first of which is read; none is called refused, and the list of the uploader is empty again."""
    page.set_input_files("input[type=file]", [str(file) for file in files])
    page.get_by_text(re.compile(r"\d+ channels")).first.wait_for()
    assert page.get_by_text("Refused").count() == 0
    page.locator(".q-uploader__file").first.wait_for(state="detached")


def wait_for_evidence(page):
    page.get_by_text("The prediction explains").first.wait_for(timeout=60_000)


def signals(page):
    """Go to the page Signals, and wait for its evidence."""
    page.goto("/signals")
    wait_for_evidence(page)


def log(page):
    """Go to the page Log, and wait for its table."""
    page.goto("/")
    page.get_by_label("Channels", exact=True).and_(page.locator("table")).wait_for(state="attached")  # folded if narrow


def section(page, signal):
    return page.get_by_role("region", name=signal, exact=True)


def field_of(page, key):
    """The field of a key of the trailer's yaw rate."""
    return section(page, TRAILER).get_by_label(f"{key} of {TRAILER}", exact=True)


def explained(page, signal):
    """Percentage that the prediction explains, when it is no longer computed."""
    page.get_by_role("status", name="Computing").wait_for(state="hidden")
    text = section(page, signal).get_by_text("The prediction explains").inner_text()
    return float(re.search(r"explains ([\d.]+)", text)[1])


def mapped(folder):
    return SignalMap.load(folder / "signals.toml").signals


def test_an_inverted_sign_and_a_delay_are_found_beside_the_plot_and_mended_by_one_click(page, folder):
    signals(page)
    section(page, TRAILER).get_by_role("button", name="−", exact=True).click()
    page.get_by_role("button", name=f"Mend {TRAILER}").wait_for()
    assert explained(page, TRAILER) < 10
    assert mapped(folder)[TRAILER].sign == -1
    section(page, TRAILER).locator(".fw-finding").get_by_role("img", name="error").wait_for()
    page.get_by_label("Find a signal").fill("semi")
    section(page, "speed").wait_for(state="hidden")
    assert section(page, TRAILER).is_visible()
    page.get_by_role("button", name=f"Mend {TRAILER}").click()
    page.get_by_text("Nothing speaks against the map.").wait_for()
    assert explained(page, TRAILER) > 95
    assert mapped(folder)[TRAILER].sign == 1

    field_of(page, "Delay").fill("0.35")
    button = page.get_by_role("button", name=re.compile(f"(Mend|Correct the delay of) {TRAILER}"))
    button.wait_for()
    assert explained(page, TRAILER) < 80
    button.click()
    section(page, TRAILER).get_by_text(re.compile("explains (9[5-9]|100)")).wait_for()
    assert explained(page, TRAILER) > 95
    assert mapped(folder)[TRAILER].delay == pytest.approx(0, abs=0.05)


def test_a_reload_and_a_second_tab_show_a_change_which_is_undone_by_keys(browser, page, folder):
    signals(page)
    field_of(page, "Delay").fill("0.2")
    page.get_by_role("button", name=re.compile(f"Undo: {TRAILER}: delay 0.2")).wait_for()
    page.reload()
    field_of(page, "Delay").wait_for()
    assert field_of(page, "Delay").input_value() == "0.2"
    page.get_by_role("button", name="Propose a map").focus()
    page.keyboard.press("Control+z")
    page.get_by_role("button", name=re.compile(f"Redo: {TRAILER}")).wait_for()
    assert mapped(folder)[TRAILER].delay == 0.0
    page.locator("#main").focus()
    page.keyboard.press("Control+y")
    page.get_by_role("button", name=re.compile(f"Undo: {TRAILER}: delay 0.2")).wait_for()
    assert mapped(folder)[TRAILER].delay == 0.2
    with tab(browser, page.url) as other:
        # the second tab of another session of the browser is a tab like any other
        field_of(other, "Delay").wait_for()
        field_of(page, "Delay").fill("0.1")
        other.get_by_role("button", name=re.compile(f"Undo: {TRAILER}: delay 0.1")).wait_for()
        assert field_of(other, "Delay").input_value() == "0.1"
        field_of(other, "Gain").fill("2")
        page.get_by_role("button", name=re.compile(f"Undo: {TRAILER}: gain 2")).wait_for()
    channel = mapped(folder)[TRAILER]
    assert (channel.delay, channel.gain) == (0.1, 2.0)


def test_windows_are_excluded_by_mouse_and_by_keyboard(page, folder):
    log(page)
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
    text = (folder / "workspace.toml").read_text()
    assert "12.0" in text
    assert "13.5" in text


UNLABELLED = """[...document.querySelectorAll('#main button, #main input, #main [role=checkbox], #main a')]
  .filter(e => e.offsetParent && !e.closest('.modebar') && !(e.innerText || '').trim()
    && !e.getAttribute('aria-label') && !e.labels?.length && !e.closest('label')
    && !e.closest('[aria-label]') && !e.getAttribute('title'))
  .map(e => e.outerHTML.slice(0, 200))"""

INSIDE = """[...document.querySelectorAll('.fw-nav a')].map(e => e.getBoundingClientRect())
  .every(box => box.left >= 0 && box.right <= innerWidth && box.bottom > box.top)"""


def test_no_page_is_wider_than_the_window_and_every_control_has_a_label(page):
    cut = "[...document.querySelectorAll('.fw-scroll')].filter(e => e.scrollWidth > e.clientWidth).length"
    for width in (390, 1400):
        page.set_viewport_size({"width": width, "height": 1000})
        for show in (log, signals):
            show(page)
            page.wait_for_timeout(1000)
            assert page.evaluate("document.documentElement.scrollWidth") <= width
            assert page.evaluate(UNLABELLED) == []
            assert page.evaluate(INSIDE)
            assert show is signals or page.evaluate(cut) == 0
    page.get_by_text("bend <b>", exact=True).wait_for()
    assert page.title() == "Signals - bend <b> - fifthwheel"
    assert page.get_by_role("navigation", name="Pages").get_by_role("link").count() == 8


RANGES = """[...document.querySelectorAll('.fw-time')].filter(e => e._fullLayout)
  .map(e => e._fullLayout.xaxis.range.map(x => Math.round(x)))"""


def test_one_cursor_shows_values_and_the_zoom_is_kept_between_pages(page):
    log(page)
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


def test_a_new_workspace_leads_to_the_next_step_refuses_files_and_asks_for_the_time(browser, tmp_path):
    folder = Workspace(tmp_path / "w").folder
    large, broken, unnamed = (tmp_path / f"{name}.csv" for name in ("large", "broken", "unnamed"))
    large.write_text("time,x\n" + "1,2\n" * 300_000)
    broken.write_bytes(b"\x00\x01" * 5000)
    first, rest = LOG.read_text().split("\n", 1)
    assert first.startswith("time")
    lines = [line.split(",", 1) for line in rest.splitlines()]  # with jitter: a regular clock is found without a name
    rest = "\n".join(f"{float(time) + 0.002 * (k % 3):.4f},{others}" for k, (time, others) in enumerate(lines))
    unnamed.write_text(f"{first.replace('time', 'run', 1)}\n{rest}\n".replace("run [s]", "run"))
    dark = "document.body.classList.contains('body--dark')"

    def leads_to(name):
        page.get_by_role("link", name=f"To the page {name}").click()
        page.get_by_role("heading", name=name, level=1).wait_for()

    with served(folder, "--max-file", "0.001") as address, tab(browser, address, faults=False) as page:
        with watched(page):
            page.wait_for_function(f"!{dark}")
            page.emulate_media(color_scheme="dark")
            page.wait_for_function(dark)
            page.get_by_role("button", name="Theme: system").click()
            page.wait_for_function(f"!{dark}")
            page.get_by_role("button", name="Theme: light").click()
            page.emulate_media(color_scheme="light")
            page.wait_for_function(dark)
            page.goto(f"{address}signals")
            leads_to("Log")
            page.wait_for_function(dark)
            page.get_by_role("button", name="Theme: dark").wait_for()

        page.set_input_files("input[type=file]", str(large))
        page.get_by_text("Refused: too large").wait_for()
        page.set_input_files("input[type=file]", str(broken))
        page.get_by_role("alert").filter(has_text="broken.csv").wait_for()
        page.get_by_role("button", name="Undo: leave out broken.csv").wait_for()
        assert not page.get_by_label("Use broken.csv").is_checked()
        assert not Workspace(folder).choices().of("broken.csv").use
        assert [path.name for path in (folder / "logs").iterdir()] == ["broken.csv"]

        page.set_input_files("input[type=file]", str(unnamed))
        page.get_by_text("No column has the name of a time.").wait_for(timeout=60_000)
        page.get_by_label("Time column of unnamed.csv").click()
        page.get_by_role("option", name="run", exact=True).click()
        page.get_by_text("17.0 s, 13 channels").wait_for(timeout=60_000)
        page.get_by_role("link", name="2 Signals").click()
        wait_for_evidence(page)
        page.goto(f"{address}check")
        leads_to("Truck")
        page.goto(f"{address}compare")
        leads_to("Identify")
    assert '[time]\ncolumn = "run"' in (folder / "signals.toml").read_text()
