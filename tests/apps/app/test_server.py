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


def test_pages_are_answered_and_load_nothing_from_elsewhere(address):
    for page in ("/", "/signals", "/truck", "/check", "/identify", "/explore", "/compare", "/history"):
        status, text = get(address, page)
        assert status == 200
        for begin in ('src="http', 'href="http', 'url("http', "from 'http", 'from "http'):
            assert begin not in text, page


def test_other_hosts_and_origins_are_refused(address):
    assert get(address, "/", Host="evil.example")[0] == 421
    assert get(address, "/", Origin="https://evil.example")[0] == 403
    socket = {"Connection": "Upgrade", "Upgrade": "websocket", "Sec-WebSocket-Version": "13"}
    socket |= {"Sec-WebSocket-Key": "dGhlIHNhbXBsZSBub25jZQ=="}
    path = "/_nicegui_ws/socket.io/?EIO=4&transport=websocket"
    assert get(address, path, **socket)[0] == 403
    assert get(address, path, **socket, Origin="https://evil.example")[0] == 403
    assert get(address, "/_nicegui/client/x/upload/1", "POST")[0] == 401


STATIC = f"/_nicegui/{version('nicegui')}/static"
PATHS = (
    "/../secret.txt", "/%2e%2e/secret.txt", "/_nicegui/../../secret.txt", "//etc/passwd", "/logs/../signals.toml",
    f"{STATIC}/../../../../../../../../etc/passwd", f"{STATIC}/%2e%2e{'/%2e%2e' * 7}/etc/passwd",
    "/workspace.toml", "/.workbench/state.json", "/docs", "/openapi.json",
)  # fmt: skip


def test_files_are_not_served(address):
    for path in PATHS:
        status, text = get(address, path)
        assert status == 404, path
        assert "root:" not in text
        assert "secret" not in text
    for log in ("../../secret.txt", "/etc/passwd", "<script>alert(1)</script>"):
        status, text = get(address, f"/?log={quote(log)}")
        assert status == 200
        assert "root:" not in text
        assert "<script>alert" not in text


def test_the_token_is_asked_for_and_nothing_is_written_outside_the_workspace(address, tmp_path):
    """A port in use is an error with a cure."""
    home, place = tmp_path / "home", tmp_path / "place"
    home.mkdir()
    place.mkdir()
    command = [sys.executable, "-m", "fifthwheel", "app", "workspace", "--no-browser", "--port"]
    environment = {"HOME": str(home), "TMPDIR": str(home), "FIFTHWHEEL_CACHE": str(tmp_path / "cache")}
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT, "text": True}
    options = {"cwd": place, "env": os.environ | environment, **pipes}
    with subprocess.Popen([*command, "0", "--token", "correct horse"], **options) as process:
        own = process.stdout.readline().strip()
        assert own.endswith("/?token=correct%20horse")
        for path, status in (("/", 401), ("/signals", 401), ("/?token=wrong", 401), (f"/?{urlsplit(own).query}", 303)):
            assert get(own, path)[0] == status
        process.terminate()
        said = process.stdout.read()
    assert [path.name for path in place.iterdir()] == ["workspace"]
    assert not [path for path in home.rglob("*") if path.is_file()]
    assert not list((place / "workspace").glob(".nicegui"))
    assert "Traceback" not in said
    other = subprocess.run([*command, str(urlsplit(address).port)], **options, timeout=60, check=False)
    assert other.returncode == 2
    assert "give another --port" in other.stdout
