"""The page: who may read it, what it sends, and what a browser shows."""

import http.client
import json
import re
import threading
from dataclasses import replace

import pytest

from fifthwheel.apps.live import coach as coaching
from fifthwheel.apps.live.checkpoint import make_learning
from fifthwheel.apps.live.outputs.recorder import BackgroundWriter
from fifthwheel.apps.live.page.server import Page
from fifthwheel.apps.live.session import Session
from fifthwheel.apps.live.setup import completed_map, make_node
from fifthwheel.base.errors import FifthwheelError
from tests.apps.app.served import chromium, tab
from tests.apps.live.truck_bus import SIGNALS, TRUCK, driven, frames, observer_node, write_files


def started(folder):
    """A page after eight seconds, and its session."""
    node = observer_node(write_files(folder))
    session = Session(node=node, writer=BackgroundWriter())
    page = Page("0", TRUCK, session)
    session.views = [page]
    for frame in frames(driven()):
        for output in node.receive(frame):
            session.handle(output)
    return page, session


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    page, session = started(tmp_path_factory.mktemp("page"))
    yield page
    session.close()


@pytest.fixture
def own_page(tmp_path):
    page, session = started(tmp_path)
    yield page
    session.close()


def learning_from(folder, coach=False):
    """A page with the parameters of a learner after two seconds, and its session."""
    learning = make_learning(TRUCK, SIGNALS, trailer="depot 1")
    node = make_node(completed_map(write_files(folder)), learning)
    coach = coaching.Coach(learning) if coach else None
    session = Session(node=node, writer=BackgroundWriter(), learning=learning, coach=coach)
    session.views = [page := Page("0", TRUCK, session)]
    for frame in list(frames(driven()))[:600]:
        for output in node.receive(frame):
            session.handle(output)
    return page, session


@pytest.fixture(scope="module")
def learning_page(tmp_path_factory):
    page, session = learning_from(tmp_path_factory.mktemp("learning"))
    yield page
    session.close()


def get(page, path="/", **headers):
    port = int(page.address.split(":")[2].strip("/"))
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=5)
    connection.request("GET", path, headers=headers)
    return connection.getresponse()


NAMES = ("evil.example", "evil.example:8080", "127.0.0.1.evil.example", "localhost.evil", "", "[x")


def test_only_addresses_and_only_the_own_paths_are_answered(page):
    """Names are refused against DNS rebinding."""
    assert page._server.server_address[0] == "127.0.0.1"
    for host in ("127.0.0.1", "127.0.0.1:8080", "localhost:1", "[::1]:8080", "192.168.1.7"):
        assert get(page, Host=host).status == 200
    for host in NAMES:
        for path in ("/", "/events", "/truck.json"):
            assert get(page, path, Host=host).status == 421
    for path in ("/nothing", "/../server.py", "/page.html", "//etc/passwd", "/page.css?x"):
        assert get(page, path).status == 404


def test_nothing_is_loaded_from_elsewhere(page):
    for path in ("/", "/page.css", "/page.js", "/plots.js", "/drawings.js"):
        answer = get(page, path)
        assert "default-src 'none'" in answer.headers["Content-Security-Policy"]
        text = answer.read().decode().replace("http://www.w3.org/2000/svg", "")
        assert "http:" not in text
        assert "https:" not in text


def test_events_begin_with_the_last_minute(page):
    answer = get(page, "/events")
    assert answer.readline() == b"event: history\n"
    history = json.loads(answer.readline().removeprefix(b"data: "))
    assert [snapshot["time"] for snapshot in history] == pytest.approx([0.1 * k for k in range(80)], abs=0.011)
    assert history[-1]["status"] == "OK"
    assert history[-1]["states"]["sideslip.semitrailer.sigma"] > 0


@pytest.mark.slow
def test_connections_are_limited(own_page):
    held = [get(own_page, "/events") for _ in range(32)]
    with pytest.raises((ConnectionError, http.client.HTTPException)):
        get(own_page)
    assert len(held) == 32


def test_a_wrong_address_and_a_port_in_use_are_refused(page):
    for address in ("http", "host:port", "70000", ""):
        with pytest.raises(FifthwheelError, match="expected a port"):
            Page(address, TRUCK, None)
    with pytest.raises(FifthwheelError, match="give another port"):
        Page(page.address.split(":")[2].strip("/"), TRUCK, None)


@pytest.mark.slow
def test_a_browser_shows_states_drawings_parameters_and_what_to_drive_next(
    own_page, learning_page, tmp_path, monkeypatch
):
    few = replace(coaching.DRIVEN, speeds=(88 / 3.6,), frequencies=(0.4,), accelerations=(1.0,))
    monkeypatch.setattr(coaching, "DRIVEN", few)
    painted = """[...document.querySelectorAll('#plots canvas')].every((canvas) =>
        canvas.getContext('2d').getImageData(60, 0, canvas.width - 60, canvas.height).data.some((v) => v))"""
    with chromium() as shown:
        for width in (390, 1400):
            with tab(shown, own_page.address, width) as page:
                page.locator("#status", has_text="ok").wait_for()
                assert page.evaluate("document.documentElement.scrollWidth") <= width
                assert page.locator("#plots canvas").count() == 5
                assert "rotate(" in page.locator("#above g").first.get_attribute("transform")
                while not page.evaluate(painted):
                    page.wait_for_timeout(100)
        with tab(shown, learning_page.address) as page:
            caption = page.locator("#parameters figcaption").first
            text = caption.inner_text()
            assert re.match(r"Front tyres, cornering stiffness\s*[\d\u202f]+ ± \d+ kN/rad, not excited", text)
            assert caption.get_attribute("title") == "tractor.front.cornering_stiffness"
            assert "semitrailer" not in page.locator("main").inner_text()
        coached, session = learning_from(tmp_path, coach=True)
        with tab(shown, coached.address) as page:
            page.get_by_text("88 km/h: ").first.wait_for()
            assert page.locator("#targets meter").count() == 4
            assert (
                page.evaluate("parseFloat(getComputedStyle(document.getElementById('headline')).fontSize)") > 60
            )  # px
        session.close()
        with tab(shown, own_page.address, faults=False) as page:
            page.locator("#status", has_text="ok").wait_for()
            threading.Thread(target=own_page.snapshots.close).start()
            page.locator("#status", has_text="ended").wait_for()
