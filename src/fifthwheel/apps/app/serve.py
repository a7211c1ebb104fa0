"""Start of the server: it listens on this computer only, unless a token is set."""

import os
import secrets
import socket
import tempfile
import webbrowser
from collections.abc import Callable
from pathlib import Path
from typing import Any
from urllib.parse import quote

from fifthwheel.apps.addresses import is_loopback
from fifthwheel.apps.app.access import MAX_FILE, Access, Guard
from fifthwheel.apps.app.workspace import HIDDEN, Workspace
from fifthwheel.base.errors import FifthwheelError
from fifthwheel.base.lazy import require
from fifthwheel.base.spelling import start_front_end


def serve(
    folder: Path,
    *,
    host: str = "127.0.0.1",
    port: int = 0,
    token: str | None = None,
    max_file: int = MAX_FILE,
    ready: Callable[[str], None] = print,
    browser: bool = False,
) -> None:
    """Serve the pages of a workspace until the process is interrupted.

    Args:
        folder: of the workspace, made if it is missing.
        host: address to listen at.
        port: to listen at; 0: a free one.
        token: who opens the pages must know it; needed where another computer could.
        max_file: largest dropped file, bytes.
        ready: called with the address of the first page when it can be opened.
        browser: whether to open it.

    Raises:
        FifthwheelError: another address than of this computer without a token, an address that cannot be used, or
            nicegui is not installed.
    """
    named = f"[{host}]" if ":" in host else host
    local = is_loopback(named)
    if not local and token is None:
        raise FifthwheelError(f"--host {host}: other computers could change the files; set --token too")
    if token is not None and len(token) < 8:
        raise FifthwheelError("--token: at least 8 characters expected; choose a longer one")
    workspace = Workspace(folder)
    listening = _listening(host, port)
    port = listening.getsockname()[1]
    _keep_inside(workspace)
    require("nicegui", "app")
    access = Access(local=local, token=token, port=port, max_file=max_file)
    address = f"http://{named}:{port}/"
    opened = address if token is None else f"{address}?token={quote(token)}"

    def started() -> None:
        ready(opened)
        if browser:
            webbrowser.open(opened)

    import uvicorn

    server = uvicorn.Server(
        uvicorn.Config(application(workspace.folder, access, started), log_level="error", ws_max_size=2_000_000)
    )
    server.run(sockets=[listening])


def application(folder: Path, access: Access, started: Callable[[], None] = lambda: None) -> Any:
    """The pages as an ASGI application; once in a process, because NiceGUI has one."""
    from fastapi import FastAPI
    from nicegui import app as pages
    from nicegui import ui

    from fifthwheel.apps.app import documents, jobs, layout, runs
    from fifthwheel.apps.app.pages import BUILDERS

    start_front_end("workbench")
    layout.register(folder, BUILDERS)
    documents.register_files(folder)
    pages.on_startup(started)
    pages.on_startup(lambda: jobs.compute(runs.prepare))
    pages.on_shutdown(jobs.cancel_all)
    server = FastAPI(docs_url=None, redoc_url=None, openapi_url=None)
    ui.run_with(
        server,
        title="fifthwheel",
        favicon=layout.ICON,
        storage_secret=secrets.token_urlsafe(),
        show_welcome_message=False,
        reconnect_timeout=30.0,
    )
    server.add_middleware(Guard, access=access)
    return server


def _listening(host: str, port: int) -> socket.socket:
    try:
        family = socket.AF_INET6 if ":" in host else socket.AF_INET
        return socket.create_server((host, port), family=family, backlog=64)
    except OSError as error:
        raise FifthwheelError(
            f"{host}:{port}: cannot be used ({error.strerror or error}); give another --port"
        ) from error


def _keep_inside(workspace: Workspace) -> None:
    """Let the libraries write nowhere else; before they are imported."""
    os.environ["NICEGUI_STORAGE_PATH"] = str(workspace.folder / HIDDEN / "nicegui")
    workspace.discard_parts()
    tempfile.tempdir = str(workspace.uploads)
