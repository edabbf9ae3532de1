"""Page of a twin in a browser: a small server on the loopback interface that sends the state, and reads nothing.

Only GET requests with the token of the printed address are answered, and only for the host names of the loopback
interface (a foreign name that resolves to 127.0.0.1 is refused). The state is sent as server-sent events.
"""

from __future__ import annotations

import hmac
import json
import secrets
import threading
import time
from collections import deque
from collections.abc import Iterator
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib import resources
from types import TracebackType
from typing import Any, Final, Self
from urllib.parse import parse_qs, urlsplit

import numpy as np

from taxel.hand.errors import format_address
from taxel.twin.errors import TwinInputError
from taxel.twin.prediction import TwinFrame
from taxel.twin.session import TwinSession, Update

SENDS_HZ: Final = 5.0
"""Largest rate at which the state is sent to a page, hertz."""

SHOWN_EVENTS: Final = 100
"""Number of the latest events that the server keeps."""

MAX_CLIENTS: Final = 32
"""Largest number of open pages; each needs a thread."""

HISTORY: Final = 300
"""Number of the latest RMS residuals in the history that a page shows."""


class TwinPage:
    """Server of the page. url: address of the page with the access token."""

    def __init__(self, session: TwinSession, port: int = 0) -> None:
        """Create the server on 127.0.0.1. port: 0 selects a free port. Raises TwinInputError for a port in use."""
        self._session = session
        self._token = secrets.token_urlsafe(24)
        self._events: deque[dict[str, Any]] = deque(maxlen=SHOWN_EVENTS)
        self._history: deque[float] = deque(maxlen=HISTORY)
        self._state = b"{}"
        self._layout = json.dumps(make_layout(session)).encode()
        self._is_ended = threading.Event()
        self._clients = threading.BoundedSemaphore(MAX_CLIENTS)
        try:
            self._server = ThreadingHTTPServer(("127.0.0.1", port), _make_handler(self))
        except OSError as error:
            raise TwinInputError(f"port {port}", "a free port", str(error.strerror), "choose another --port") from None
        self._server.daemon_threads = True
        self.port = self._server.server_address[1]
        self.url = f"http://127.0.0.1:{self.port}/?token={self._token}"

    def __enter__(self) -> Self:
        threading.Thread(target=self._server.serve_forever, daemon=True).start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Stop the server and disconnect its clients."""
        self._is_ended.set()
        self._server.shutdown()
        self._server.server_close()

    def follow(self, updates: Iterator[Update]) -> Iterator[Update]:
        """Yield the updates unchanged; publish the newest state at most `SENDS_HZ` times a second, and with every
        event.
        """
        due = 0.0
        newest: TwinFrame | None = None
        for update in updates:
            yield update
            newest = update.frame or newest
            self._events += [event.to_json() | {"text": str(event)} for event in update.events]
            if update.frame is not None and np.isfinite(update.frame.rms):
                self._history.append(round(update.frame.rms, 3))
            if newest is not None and (time.monotonic() >= due or update.events):
                self._publish(newest)
                due = time.monotonic() + 1.0 / SENDS_HZ

    def wait(self) -> None:
        """Block until the program is interrupted (Ctrl-C), so that the page stays available."""
        while True:
            time.sleep(0.5)

    def _publish(self, frame: TwinFrame) -> None:
        """Store the state with the newest frame, which `send_events` sends to all clients."""
        state = {
            "time_s": frame.time_s,
            "condition": frame.condition,
            "measured": _to_list(frame.measured),
            "predicted": _to_list(frame.predicted),
            "residual": _to_list(frame.residual, 2),
            "history": list(self._history),
            "skipped": self._session.skipped,
            "active": [test.alarm.number for test in self._session.twin.active.values()],
            "events": list(self._events)[-20:],
        }
        self._state = json.dumps(state, allow_nan=False).encode()

    def is_permitted(self, host: str, query: dict[str, list[str]]) -> bool:
        """Whether a request's Host header names this server and its query contains the token."""
        token = query.get("token", [""])[-1]
        hosts = {f"127.0.0.1:{self.port}", f"localhost:{self.port}"}
        return host in hosts and hmac.compare_digest(token.encode(), self._token.encode())

    def render(self) -> bytes:
        """Render the page with layout and current state, so that it is complete before the first server-sent event."""
        text = resources.files("taxel.twin").joinpath("twin.html").read_bytes()
        for name, value in ((b"{{layout}}", self._layout), (b"{{state}}", self._state)):
            # An escaped "<" cannot end the script element that contains the JSON value.
            text = text.replace(name, value.replace(b"<", b"\\u003c"))
        return text

    def send_events(self, handler: BaseHTTPRequestHandler) -> None:
        """Send the state whenever it changes, until the client disconnects or the server ends.

        The client gets the status 503 if `MAX_CLIENTS` pages are open already.
        """
        if not self._clients.acquire(blocking=False):
            handler.send_error(HTTPStatus.SERVICE_UNAVAILABLE)
            return
        try:
            handler.send_response(HTTPStatus.OK)
            handler.send_header("Content-Type", "text/event-stream")
            handler.send_header("Cache-Control", "no-store")
            handler.end_headers()
            last = b""
            while not self._is_ended.wait(1.0 / SENDS_HZ):
                if self._state is not last:
                    last = self._state
                    handler.wfile.write(b"data: " + last + b"\n\n")
                    handler.wfile.flush()
        except OSError:
            pass  # the client has disconnected
        finally:
            self._clients.release()


def make_layout(session: TwinSession) -> dict[str, Any]:
    """Return name, address and taxels of each board as JSON values; row and column of a taxel are its TX and RX
    line.
    """
    reference = session.twin.reference
    boards = []
    for number, (address, name) in enumerate(
        zip(reference.sensors.address.tolist(), reference.sensors.name, strict=True)
    ):
        taxels = np.flatnonzero(reference.places.board == number)
        boards.append(
            {
                "name": name.replace("_", " "),
                "address": format_address(address),
                "taxels": taxels.tolist(),
                "row": reference.taxels.tx[taxels].tolist(),
                "column": reference.taxels.rx[taxels].tolist(),
            }
        )
    return {"boards": boards}


def _to_list(values: np.ndarray, digits: int = 0) -> list[float | None]:
    """Round the values to `digits` decimals; values that are not finite become None."""
    rounded = np.round(values, digits).tolist()
    return [value if known else None for value, known in zip(rounded, np.isfinite(values).tolist(), strict=True)]


def _make_handler(page: TwinPage) -> type[BaseHTTPRequestHandler]:
    """Create the class that handles the requests to a page."""

    class Handler(BaseHTTPRequestHandler):
        """Answers GET requests that contain the token of the page; refuses others with the status 403."""

        timeout = 30

        def do_GET(self) -> None:
            """Send the page (path /) or the stream of its states (path /events); other paths get the status 404."""
            parts = urlsplit(self.path)
            if not page.is_permitted(self.headers.get("Host", ""), parse_qs(parts.query)):
                self.send_error(HTTPStatus.FORBIDDEN)
            elif parts.path == "/":
                self._send_page()
            elif parts.path == "/events":
                page.send_events(self)
            else:
                self.send_error(HTTPStatus.NOT_FOUND)

        def _send_page(self) -> None:
            """Send the rendered page with headers that forbid caching and foreign content."""
            body = page.render()
            self.send_response(HTTPStatus.OK)
            self.send_header("Content-Type", "text/html; charset=utf-8")
            self.send_header("Content-Length", str(len(body)))
            self.send_header("Cache-Control", "no-store")
            self.send_header("Referrer-Policy", "no-referrer")
            self.send_header(
                "Content-Security-Policy",
                "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; connect-src 'self'",
            )
            self.end_headers()
            self.wfile.write(body)

        def log_message(self, format: str, *args: object) -> None:
            """Print nothing: the terminal shows the events of the twin."""

    return Handler
