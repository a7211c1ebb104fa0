"""The web server of the page. It loads nothing from elsewhere, and answers only to addresses, not to names."""

import json
import threading
from functools import cached_property
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib import resources
from socket import socket
from typing import Any

from fifthwheel.apps.addresses import is_address
from fifthwheel.apps.live.node import Output
from fifthwheel.apps.live.page.snapshots import Snapshots
from fifthwheel.apps.live.session import Session
from fifthwheel.base.errors import FifthwheelError
from fifthwheel.base.plots.items import CYCLE
from fifthwheel.truck import Vehicle
from fifthwheel.truck.drawing import FLOOR, FRAME, OVERHANG, TRACK, WHEEL_RADIUS, WHEEL_WIDTH
from fifthwheel.truck.spoken_names import named_unit

POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; img-src data:; frame-ancestors 'none'"
)
"""What the page may load."""
CONNECTIONS = 32
"""Connections at the same time; further ones are refused."""
PATIENCE = 5.0
"""Longest time for a request, or for a browser to accept data, s."""
KEEP_ALIVE = 2.0
"""Time after which a page without news receives an empty comment, s."""
_FILES = {
    "/": ("page.html", "text/html; charset=utf-8"),
    "/page.css": ("page.css", "text/css; charset=utf-8"),
    "/page.js": ("page.js", "text/javascript; charset=utf-8"),
    "/drawings.js": ("drawings.js", "text/javascript; charset=utf-8"),
    "/plots.js": ("plots.js", "text/javascript; charset=utf-8"),
}


class Page:
    """Serves the page of a session, with drawings of the vehicle.

    The address is "8080", for this computer only, or "HOST:PORT"; a FifthwheelError for another form, or one that
    cannot be used.
    """

    def __init__(self, address: str, vehicle: Vehicle, session: Session) -> None:
        host, _, port = address.rpartition(":")
        host = host.strip("[]") or "127.0.0.1"
        if not port.isdigit() or int(port) > 65535:
            raise FifthwheelError(f"--page {address}: expected a port such as 8080, or HOST:PORT")
        self.snapshots = Snapshots(session)
        try:
            self._server = _Server((host, int(port)), self.snapshots, vehicle)
        except OSError as error:
            raise FifthwheelError(
                f"--page {address}: cannot be used ({error.strerror or error}); give another port"
            ) from error
        self.address = f"http://{f'[{host}]' if ':' in host else host}:{self._server.server_port}/"
        """Of the page."""
        self._thread = threading.Thread(target=self._server.serve_forever, name="fifthwheel page", daemon=True)
        self._thread.start()

    def show(self, output: Output) -> None:
        self.snapshots.show(output)

    def close(self) -> None:
        self.snapshots.close()
        self._server.shutdown()
        self._server.server_close()
        self._thread.join()


class _Server(ThreadingHTTPServer):
    daemon_threads = True
    block_on_close = False

    def __init__(self, address: tuple[str, int], snapshots: Snapshots, vehicle: Vehicle) -> None:
        self.snapshots, self._vehicle = snapshots, vehicle
        self._free = threading.BoundedSemaphore(CONNECTIONS)
        super().__init__(address, _Handler)

    @cached_property
    def truck(self) -> bytes:
        """The truck for the drawings, as JSON."""
        return json.dumps(geometry(self._vehicle)).encode()

    def process_request(self, request: Any, client_address: Any) -> None:
        """Serve a connection in a thread of its own, unless there are too many."""
        if self._free.acquire(blocking=False):
            super().process_request(request, client_address)
        else:
            self.shutdown_request(request)

    def process_request_thread(self, request: Any, client_address: Any) -> None:
        """Serve a connection."""
        try:
            super().process_request_thread(request, client_address)
        finally:
            self._free.release()

    def handle_error(self, request: socket | tuple[bytes, socket], client_address: Any) -> None:
        """A browser that goes away is no error of the node."""


class _Handler(BaseHTTPRequestHandler):
    server: _Server
    timeout = PATIENCE
    server_version = "fifthwheel"
    sys_version = ""

    def do_GET(self) -> None:
        if not is_address(self.headers.get("Host", "")):
            self._answer(
                b"Use the address of this computer, such as 127.0.0.1.\n", status=HTTPStatus.MISDIRECTED_REQUEST
            )
        elif self.path in _FILES:
            name, kind = _FILES[self.path]
            self._answer((resources.files(__package__) / name).read_bytes(), kind)
        elif self.path == "/truck.json":
            self._answer(self.server.truck, "application/json")
        elif self.path == "/events":
            self._stream()
        else:
            self._answer(b"There is no such page.\n", status=HTTPStatus.NOT_FOUND)

    def log_message(self, format: str, *args: Any) -> None:
        """Requests are not logged."""

    def _answer(self, body: bytes, kind: str = "text/plain", *, status: HTTPStatus = HTTPStatus.OK) -> None:
        self._head(kind, status)
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)

    def _head(self, kind: str, status: HTTPStatus = HTTPStatus.OK) -> None:
        self.send_response(status)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Security-Policy", POLICY)
        self.send_header("Cross-Origin-Resource-Policy", "same-origin")
        self.send_header("X-Content-Type-Options", "nosniff")
        self.send_header("Cache-Control", "no-store")

    def _stream(self) -> None:
        """Server-sent events: the last minute, then every snapshot, or the newest where the browser is slow."""
        snapshots = self.server.snapshots
        self._head("text/event-stream")
        self.end_headers()
        count, text = snapshots.history()
        self._event(f"event: history\ndata: {text}\n\n")
        while not snapshots.ended:
            count, text = snapshots.after(count, KEEP_ALIVE)
            self._event(f"data: {text}\n\n" if text else ": \n\n")
        self._event("event: end\ndata: \n\n")

    def _event(self, text: str) -> None:
        self.wfile.write(text.encode())
        self.wfile.flush()


def geometry(vehicle: Vehicle) -> dict[str, Any]:
    """The truck for the drawings, for JSON: lengths in m, on each unit with x forward from its own origin."""
    units = []
    for k, unit in enumerate(vehicle.units):
        ahead = vehicle.couplings[k - 1].trailing_position if k else None
        behind = vehicle.couplings[k].leading_position if k < len(vehicle.couplings) else None
        ends = [axle.position for axle in unit.axles] + [x for x in (ahead, behind) if x is not None]
        payload = unit.payload
        units.append(
            {
                "name": unit.name,
                "title": named_unit(unit.name),
                "colour": CYCLE[k % 3],
                "rear": min(ends) - OVERHANG,
                "front": max(ends) + OVERHANG,
                "width": payload.width if payload else TRACK + WHEEL_WIDTH,
                "cog": unit.cog,
                "ahead": ahead,
                "behind": behind,
                "axles": [
                    {"x": axle.position, "steer": f"steer.{unit.name}.{axle.name}" if axle.steerable else ""}
                    for axle in unit.axles
                ],
                "roll_axis": unit.roll_axis_height,
                "frame": FRAME,
                "floor": payload.floor_height if payload else max(FLOOR, 2 * unit.sprung.cog_height - FRAME),
                "load": payload.height if payload else 0.0,
            }
        )
    return {
        "name": vehicle.name,
        "units": units,
        "track": TRACK,
        "wheel": {"radius": WHEEL_RADIUS, "width": WHEEL_WIDTH},
    }
