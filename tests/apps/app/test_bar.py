"""What all pages share, in a browser: the name of what is open, the theme, and a menu that fits a telephone."""

from pathlib import Path

import pytest

from fifthwheel.apps.app.workspace import Workspace
from tests.apps.app.served import chromium, served, tab

pytestmark = pytest.mark.slow

LOG = Path(__file__).parents[3] / "examples" / "lane_changes.csv"

INSIDE = """[...document.querySelectorAll('.fw-nav a')].map(e => e.getBoundingClientRect())
  .every(box => box.left >= 0 && box.right <= innerWidth && box.bottom > box.top)"""


@pytest.fixture(scope="module")
def browser():
    with chromium() as started:
        yield started


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
