"""One document with every block, in the words of each renderer."""

import io
from xml.etree import ElementTree

import pytest
from rich.console import Console

from fifthwheel.base import pages
from fifthwheel.base.pages.html import cell, notebook, page
from fifthwheel.base.pages.terminal import show
from fifthwheel.base.plots import Line, Panel, Plot
from tests.results.report.conftest import Page

PLOT = Plot(panels=[Panel(items=[Line([0, 1], [0, 1])], title="not shown twice")])
FIGURE = pages.CaptionedPlot(
    pages.Code("yaw_rate.tractor"), PLOT, "log", ("log", "fit", "yaw_rate"), text="explained", note="rms"
)
HEADS = ("Parameter|name", "Bar", "Value>", "Verdict")
ROW = (
    pages.Code("tractor.mass"),
    pages.Markup("<i>bar</i>"),
    "7 200 ± 10 kg",
    pages.Mark("not excited", "not_excited"),
)
BLOCKS = (
    pages.Headline("It <works>", columns=[[pages.Items(["one result"], "Result")]]),
    pages.Heading("First & last", key="first"),
    pages.Hint("Explains."),
    pages.Table(HEADS, [ROW]),
    pages.Items(["give --fix NAME"], "Next steps", ordered=True),
    pages.Items([], "Nothing"),
    pages.Heading("log", badge="validation"),
    pages.Plots([FIGURE]),
    pages.Folded("More", [pages.Paragraph("folded text"), pages.Values({"tolerance": 0.01})]),
    pages.Folded(pages.Code("yaw_rate"), [], "is white noise."),
    pages.Verbatim("a < b\n  c"),
)
DOCUMENT = pages.Document("<Title>", BLOCKS, "subtitle")
WORDS = ("First & last", "Explains.", "tractor.mass", "7 200 ± 10 kg", "not excited", "give --fix NAME", "folded text")
WORDS += ("one result", "tolerance", "a < b", "is white noise.")


@pytest.fixture(scope="module")
def html() -> str:
    return page(DOCUMENT)[0].decode()


def printed() -> str:
    console = Console(file=io.StringIO(), width=100, force_terminal=True, color_system=None)
    show(DOCUMENT, console)
    return console.file.getvalue()


def test_a_page_a_notebook_and_a_terminal_have_the_same_words(html):
    shown = "".join(ElementTree.fromstring(notebook(DOCUMENT)).itertext())
    for text in (Page(html).text, shown, printed()):
        for words in WORDS:
            assert words in text.replace("\u00a0", " ")
        assert "It <works>" in text
        assert "Nothing" not in text
    assert "bar" not in printed().lower()
    assert "explained" not in printed()
    text = str(pages.Document("Title", [pages.Table(("Name", "Value>"), [("a", "1"), ("bc", "10")]), *BLOCKS[5:]]))
    assert text.startswith("Title\n\nName  Value\na         1\nbc       10")


def test_a_page_links_its_sections_and_has_places_for_its_figures(html):
    parsed = Page(html)
    assert parsed.links == [("a", "#first")]
    assert {"verdict", "first", "plot0"} <= set(parsed.ids)
    assert "yaw_<wbr/>rate.<wbr/>tractor</code>: explained<small>rms</small>" in html
    assert "not shown twice" not in parsed.data("figures").decode()
    assert "figures" not in Page(page(pages.Document("t", []))[0].decode()).scripts


def test_texts_are_escaped_and_markup_is_not(html):
    assert "<works>" not in html
    assert "<i>bar</i>" in html
    assert '<span class="option">--fix</span>' in html
    assert cell("<b>") == "&lt;b&gt;"
    assert cell("a\u202eb") == "a\\u202eb"
