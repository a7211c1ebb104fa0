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
from tests.apps.live.browser import browser
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


@pytest.fixture(scope="module")
def learning_page(tmp_path_factory):
    """A page with the parameters of a learner after two seconds."""
    learning = make_learning(TRUCK, SIGNALS, trailer="depot 1")
    node = make_node(completed_map(write_files(tmp_path_factory.mktemp("learning"))), learning)
    session = Session(node=node, writer=BackgroundWriter(), learning=learning)
    page = Page("0", TRUCK, session)
    session.views = [page]
    for frame in list(frames(driven()))[:600]:
        for output in node.receive(frame):
            session.handle(output)
    yield page
    session.close()


def get(page, path="/", **headers):
    port = int(page.address.split(":")[2].strip("/"))
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=5)
    connection.request("GET", path, headers=headers)
    return connection.getresponse()


@pytest.mark.parametrize("host", ["127.0.0.1", "127.0.0.1:8080", "localhost:1", "[::1]:8080", "192.168.1.7"])
def test_addresses_are_answered(page, host):
    assert get(page, Host=host).status == 200


@pytest.mark.parametrize(
    "host", ["evil.example", "evil.example:8080", "127.0.0.1.evil.example", "localhost.evil", "", "[x"]
)
@pytest.mark.parametrize("path", ["/", "/events", "/truck.json"])
def test_names_are_refused_against_dns_rebinding(page, host, path):
    assert get(page, path, Host=host).status == 421


@pytest.mark.parametrize("path", ["/nothing", "/../server.py", "/page.html", "//etc/passwd", "/page.css?x"])
def test_other_paths_do_not_exist(page, path):
    assert get(page, path).status == 404


def test_nothing_is_loaded_from_elsewhere(page):
    for path in ("/", "/page.css", "/page.js", "/plots.js", "/drawings.js"):
        answer = get(page, path)
        assert "default-src 'none'" in answer.headers["Content-Security-Policy"]
        text = answer.read().decode().replace("http://www.w3.org/2000/svg", "")
        assert "http:" not in text
        assert "https:" not in text


def test_it_listens_on_this_computer_only(page):
    assert page._server.server_address[0] == "127.0.0.1"


def test_events_begin_with_the_last_minute(page):
    answer = get(page, "/events")
    assert answer.readline() == b"event: history\n"
    history = json.loads(answer.readline().removeprefix(b"data: "))
    assert [snapshot["time"] for snapshot in history] == pytest.approx([0.1 * k for k in range(80)], abs=0.011)
    assert history[-1]["status"] == "OK"
    assert history[-1]["states"]["sideslip.semitrailer.sigma"] > 0


def test_parameters_have_plain_names_sigma_and_unit(learning_page):
    _, text = learning_page.snapshots.history()
    shown = {p["path"]: p for p in json.loads(text)[-1]["parameters"]}
    front = shown["tractor.front.cornering_stiffness"]
    assert front["name"] == "Front tyres, cornering stiffness"
    assert re.fullmatch(r"[\d\u202f]+ ± \d+ kN/rad, not excited", front["text"])
    assert 100 < front["value"] < 1000, "in the unit of the text"
    assert all(parameter["text"].count(" ± ") == 1 for parameter in shown.values())


@pytest.mark.slow
def test_connections_are_limited(own_page):
    held = [get(own_page, "/events") for _ in range(32)]
    with pytest.raises((ConnectionError, http.client.HTTPException)):
        get(own_page)
    assert len(held) == 32


@pytest.mark.parametrize("address", ["http", "host:port", "70000", ""])
def test_a_wrong_address_is_refused(address):
    with pytest.raises(FifthwheelError, match="expected a port"):
        Page(address, TRUCK, None)


@pytest.mark.slow
def test_a_port_in_use_is_refused(page):
    with pytest.raises(FifthwheelError, match="give another port"):
        Page(page.address.split(":")[2].strip("/"), TRUCK, None)


@pytest.mark.slow
def test_a_browser_shows_states_and_drawings(own_page, tmp_path):
    with browser(tmp_path / "profile") as shown:
        for width in (390, 1400):
            shown.open(own_page.address, width)
            shown.wait_for("document.getElementById('status').textContent === 'ok'")
            assert shown.evaluate("document.documentElement.scrollWidth") <= width
        assert shown.evaluate("document.querySelectorAll('#plots canvas').length") == 5
        assert "rotate(" in shown.evaluate("document.querySelector('#above g').getAttribute('transform')")
        painted = """[...document.querySelectorAll('#plots canvas')].every((canvas) =>
            canvas.getContext('2d').getImageData(60, 0, canvas.width - 60, canvas.height).data.some((v) => v))"""
        assert shown.wait_for(painted)
        assert not shown.messages
        threading.Thread(target=own_page.snapshots.close).start()
        shown.wait_for("document.getElementById('status').textContent === 'ended'")


@pytest.mark.slow
def test_a_browser_shows_what_to_drive_next(tmp_path, monkeypatch):
    few = replace(coaching.DRIVEN, speeds=(88 / 3.6,), frequencies=(0.4,), accelerations=(1.0,))
    monkeypatch.setattr(coaching, "DRIVEN", few)
    learning = make_learning(TRUCK, SIGNALS)
    node = make_node(completed_map(write_files(tmp_path)), learning)
    session = Session(node=node, writer=BackgroundWriter(), learning=learning, coach=coaching.Coach(learning))
    session.views = [page := Page("0", TRUCK, session)]
    for frame in list(frames(driven()))[:600]:
        for output in node.receive(frame):
            session.handle(output)
    with browser(tmp_path / "profile") as shown:
        shown.open(page.address, 1400)
        assert shown.wait_for("document.getElementById('headline').textContent").startswith("88 km/h: ")
        assert shown.evaluate("document.querySelectorAll('#targets meter').length") == 4
        size = shown.evaluate("parseFloat(getComputedStyle(document.getElementById('headline')).fontSize)")
        assert size > 60  # px
        assert not shown.messages
    session.close()


@pytest.mark.slow
def test_a_browser_shows_parameters_with_their_paths_on_hover(learning_page, tmp_path):
    with browser(tmp_path / "profile") as shown:
        shown.open(learning_page.address, 1400)
        caption = "document.querySelector('#parameters figcaption')"
        text = shown.wait_for(f"{caption} && {caption}.textContent")
        assert text.startswith("Front tyres, cornering stiffness")
        assert "kN/rad" in text
        assert shown.evaluate(f"{caption}.title") == "tractor.front.cornering_stiffness"
        assert "semitrailer" not in shown.evaluate("document.querySelector('main').innerText")
        assert not shown.messages
