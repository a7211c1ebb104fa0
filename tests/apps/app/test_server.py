"""The server in a process of its own, asked without a browser."""

import http.client
import os
import subprocess
import sys
from contextlib import closing
from importlib.metadata import version
from urllib.parse import quote, urlsplit

import pytest

from tests.apps.app.served import served

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def address(tmp_path_factory):
    folder = tmp_path_factory.mktemp("served")
    (folder / "secret.txt").write_text("secret")
    with served(folder / "workspace") as found:
        yield found


def get(address, path, method="GET", **headers):
    with closing(http.client.HTTPConnection(urlsplit(address).netloc, timeout=10)) as connection:
        connection.request(method, path, headers=headers)
        with connection.getresponse() as answer:
            return answer.status, answer.read().decode(errors="replace")


@pytest.mark.parametrize("page", ["/", "/signals", "/truck", "/check", "/identify", "/explore", "/compare", "/history"])
def test_pages_are_answered_and_load_nothing_from_elsewhere(address, page):
    status, text = get(address, page)
    assert status == 200
    for begin in ('src="http', 'href="http', 'url("http', "from 'http", 'from "http'):
        assert begin not in text


def test_other_hosts_and_origins_are_refused(address):
    assert get(address, "/", Host="evil.example")[0] == 421
    assert get(address, "/", Origin="https://evil.example")[0] == 403
    socket = {"Connection": "Upgrade", "Upgrade": "websocket", "Sec-WebSocket-Version": "13"}
    socket |= {"Sec-WebSocket-Key": "dGhlIHNhbXBsZSBub25jZQ=="}
    path = "/_nicegui_ws/socket.io/?EIO=4&transport=websocket"
    assert get(address, path, **socket)[0] == 403
    assert get(address, path, **socket, Origin="https://evil.example")[0] == 403
    assert get(address, "/_nicegui/client/x/upload/1", "POST")[0] == 401


@pytest.mark.parametrize(
    "path",
    [
        "/../secret.txt",
        "/%2e%2e/secret.txt",
        "/_nicegui/../../secret.txt",
        f"/_nicegui/{version('nicegui')}/static/../../../../../../../../etc/passwd",
        f"/_nicegui/{version('nicegui')}/static/%2e%2e/%2e%2e/%2e%2e/%2e%2e/%2e%2e/%2e%2e/%2e%2e/%2e%2e/etc/passwd",
        "//etc/passwd",
        "/logs/../signals.toml",
        "/workspace.toml",
        "/.workbench/state.json",
        "/docs",
        "/openapi.json",
    ],
)
def test_files_are_not_served(address, path):
    status, text = get(address, path)
    assert status == 404
    assert "root:" not in text
    assert "secret" not in text


@pytest.mark.parametrize("log", ["../../secret.txt", "/etc/passwd", "<script>alert(1)</script>"])
def test_names_in_the_address_lead_nowhere_else(address, log):
    status, text = get(address, f"/?log={quote(log)}")
    assert status == 200
    assert "root:" not in text
    assert "<script>alert" not in text


def test_nothing_is_written_outside_the_workspace(tmp_path):
    home, place = tmp_path / "home", tmp_path / "place"
    home.mkdir()
    place.mkdir()
    command = [sys.executable, "-m", "fifthwheel", "app", "workspace", "--port", "0", "--no-browser"]
    environment = {"HOME": str(home), "TMPDIR": str(home), "FIFTHWHEEL_CACHE": str(tmp_path / "cache")}
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT, "text": True}
    with subprocess.Popen(command, cwd=place, env=os.environ | environment, **pipes) as process:
        address = process.stdout.readline().strip()
        assert get(address, "/signals")[0] == 200
        process.terminate()
        said = process.stdout.read()
    assert [path.name for path in place.iterdir()] == ["workspace"]
    assert not [path for path in home.rglob("*") if path.is_file()]
    assert not list((place / "workspace").glob(".nicegui"))
    assert "Traceback" not in said


def test_the_token_is_asked_for(tmp_path):
    with served(tmp_path / "workspace", "--token", "correct horse") as address:
        assert address.endswith("/?token=correct%20horse")
        assert get(address, "/")[0] == 401
        assert get(address, "/signals")[0] == 401
        assert get(address, "/?token=wrong")[0] == 401
        assert get(address, f"/?{urlsplit(address).query}")[0] == 303


def test_a_port_in_use_is_an_error_with_a_cure(tmp_path):
    with served(tmp_path / "one") as address:
        port = str(urlsplit(address).port)
        command = [sys.executable, "-m", "fifthwheel", "app", str(tmp_path / "two"), "--port", port, "--no-browser"]
        other = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert other.returncode == 2
    assert "give another --port" in other.stderr
