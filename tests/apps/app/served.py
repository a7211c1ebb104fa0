"""A workbench in a process of its own, and Chromium without a window in front of it."""

import shutil
import subprocess
import sys
from contextlib import contextmanager
from urllib.parse import urlsplit

import pytest

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
HARMLESS = ("unrecognized GUI edit",)
"""Messages of plotly.js on its own selections."""


@contextmanager
def served(folder, *options):
    """The address of a workbench of a folder."""
    command = [sys.executable, "-m", "fifthwheel", "app", str(folder), "--port", "0", "--no-browser", *options]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    try:
        address = process.stdout.readline().strip()
        assert address.startswith("http://"), address + process.stdout.read()
        yield address
    finally:
        process.terminate()
        try:
            process.wait(10)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
        print(process.stdout.read())
        process.stdout.close()


@contextmanager
def chromium():
    """Chromium; the test is skipped where it or playwright is missing."""
    api = pytest.importorskip("playwright.sync_api", reason="needs playwright: pip install 'fifthwheel[test]'")
    if CHROMIUM is None:
        pytest.skip("needs Chromium: apt-get install chromium")
    with api.sync_playwright() as started:
        browser = started.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        try:
            yield browser
        finally:
            browser.close()


@contextmanager
def watched(page, faults=True):
    """At the end, nothing was asked of another host, and with `faults` no script has failed."""
    found, hosts = [], set()
    listeners = {
        "pageerror": lambda error: found.append(str(error)),
        "console": lambda message: found.append(message.text) if message.type == "error" else None,
        "request": lambda request: hosts.add(urlsplit(request.url).hostname),
        "websocket": lambda socket: hosts.add(urlsplit(socket.url).hostname),
    }
    for event, listener in listeners.items():
        page.on(event, listener)
    try:
        yield page
    finally:
        for event, listener in listeners.items():
            page.remove_listener(event, listener)
    assert hosts <= {"127.0.0.1", None}
    serious = [fault for fault in found if not any(text in fault for text in HARMLESS)]
    assert not (faults and serious), serious


@contextmanager
def tab(browser, address, width=1400, height=1000, faults=True):
    """A tab of a session of its own, which is `watched`."""
    context = browser.new_context(viewport={"width": width, "height": height}, base_url=address)
    page = context.new_page()
    page.set_default_timeout(20_000)
    with watched(page, faults):
        page.goto(address)
        yield page
        context.close()
