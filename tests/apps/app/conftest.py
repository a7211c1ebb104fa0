"""A browser, and the tab that the tests of a module share.

The module has the fixtures `started`, which gives the folder of a workspace and a tab of it, and `folder`, which
restores the files of the workspace.
"""

import pytest

from fifthwheel.apps.app.workspace import DOCUMENTS, HIDDEN
from tests.apps.app.served import chromium, watched


@pytest.fixture(scope="module")
def browser():
    with chromium() as found:
        yield found


@pytest.fixture
def emptied(started):
    """The folder without documents and choices; no page of it is open."""
    folder, page, *_ = started
    page.goto("about:blank")
    for name in (*DOCUMENTS, f"{HIDDEN}/state.json"):
        (folder / name).unlink(missing_ok=True)
    return folder


@pytest.fixture
def page(started, folder):
    page = started[1]
    page.set_viewport_size({"width": 1400, "height": 1000})
    with watched(page):
        yield page
