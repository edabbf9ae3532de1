"""Checks of the requests and messages of pages, as callbacks and connections for the library websockets."""

from __future__ import annotations

import asyncio
import http
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, Final

from websockets.asyncio.server import ServerConnection
from websockets.datastructures import Headers
from websockets.http11 import Request, Response

from taxel.monitor.web.assets import HEADERS, PageFile, make_content_policy
from taxel.monitor.web.gate import Gate, Refusal
from taxel.monitor.web.page_input import MESSAGE_BYTES_MAX
from taxel.monitor.web.refusals import Refusals

CLIENTS_MAX: Final = 64
"""Largest number of connected pages: each of them needs processor time for every drawing."""

CONNECTIONS_MAX: Final = 4 * CLIENTS_MAX
"""Largest number of open sockets of the page, also of requests that are not complete: the limit of open files of a
process is usually 1024, and the skin needs some of them.
"""

OPEN_TIMEOUT_S: Final = 5.0
"""Longest duration of a request, seconds; browsers on the same computer send a request within milliseconds."""

IGNORED_MAX: Final = 100
"""Number of ignored invalid messages after which a page is disconnected: a page of another version may send a few."""

POLICY_VIOLATION: Final = 1008
"""Close code of RFC 6455 for a message that the server refuses."""

_STATUS: Final = {
    Refusal.NOT_FOUND: http.HTTPStatus.NOT_FOUND,
    Refusal.TOO_MANY: http.HTTPStatus.SERVICE_UNAVAILABLE,
    Refusal.OTHER_CLIENT: http.HTTPStatus.BAD_REQUEST,
}
_TEXT: Final = {
    Refusal.NO_TOKEN: "open the address that 'taxel monitor' has printed; each run has a new address\n",
    Refusal.NOT_FOUND: "there is only one page\n",
    Refusal.TOO_MANY: f"at most {CLIENTS_MAX} pages can be open\n",
    Refusal.OTHER_CLIENT: "reload the page\n",
}


class Admission:
    """Server of the page that checks requests, connections and messages.

    The attribute `is_installed` states whether viser's server has taken the options with the checks.
    """

    def __init__(
        self,
        gate: Gate,
        refusals: Refusals,
        check_message: Callable[[bytes | str], Refusal | None],
        subprotocol: str,
        client: Path,
    ) -> None:
        """Create the checks of a server.

        check_message: returns why a message is ignored, None for a valid message. subprotocol: name of the WebSocket
        protocol of viser's page. client: file of viser's page.
        """
        self._gate = gate
        self.refusals = refusals
        self.check_message = check_message
        self._subprotocol = subprotocol
        self._file = PageFile(client)
        self.connections: set[Connection] = set()
        self.is_installed = False

    def get_options(self) -> dict[str, Any]:
        """Return the options of `websockets.asyncio.server.serve` that install the checks."""
        self.is_installed = True
        return {
            "process_request": self._check_request,
            "process_response": self._set_ticket,
            "create_connection": partial(Connection, admission=self),
            "max_size": MESSAGE_BYTES_MAX,
            "compression": None,
            "open_timeout": OPEN_TIMEOUT_S,
            "server_header": None,
        }

    def _check_request(self, connection: ServerConnection, request: Request) -> Response | None:
        """Return the page, or the response to a refused request; None to open the connection of a page.

        An accepted connection consumes its ticket, the secret cookie that permits one connection.
        """
        if request.headers.get("Upgrade", "").lower() != "websocket":
            refusal = self._gate.check_page(request.path, request.headers)
            return self._refuse(connection, refusal) if refusal is not None else self._make_page(request)
        refusal = self._gate.check_connection(request.path, request.headers) or self._check_client(request)
        if refusal is not None:
            return self._refuse(connection, refusal)
        self._gate.consume_ticket(request.headers)
        assert isinstance(connection, Connection)
        connection.is_page = True
        return None

    def _check_client(self, request: Request) -> Refusal | None:
        """Return why a connection is refused although its ticket is valid; None if it can be opened.

        The reasons are another subprotocol than that of viser's page, and too many connected pages.
        """
        values = request.headers.get_all("Sec-WebSocket-Protocol")
        if self._subprotocol not in [name.strip() for value in values for name in value.split(",")]:
            return Refusal.OTHER_CLIENT
        return Refusal.TOO_MANY if sum(one.is_page for one in self.connections) >= CLIENTS_MAX else None

    def _refuse(self, connection: ServerConnection, refusal: Refusal) -> Response:
        """Count a refused request, and return its response."""
        self.refusals.add(refusal)
        status = _STATUS.get(refusal, http.HTTPStatus.FORBIDDEN)
        response = connection.respond(status, _TEXT.get(refusal, f"refused: {refusal.value}\n"))
        response.headers.update(HEADERS)
        return response

    def _make_page(self, request: Request) -> Response:
        """Return the response with the page and a new ticket, the secret cookie that permits one connection."""
        is_compressed = "gzip" in request.headers.get("Accept-Encoding", "")
        body = self._file.compressed if is_compressed else self._file.plain
        headers = Headers(HEADERS)
        headers["Content-Type"] = "text/html; charset=utf-8"
        headers["Content-Length"] = str(len(body))
        headers["Content-Encoding"] = "gzip" if is_compressed else "identity"
        headers["Content-Security-Policy"] = make_content_policy(request.headers["Host"])
        headers["Set-Cookie"] = self._gate.make_cookie()
        headers["Connection"] = "close"
        return Response(http.HTTPStatus.OK, "OK", headers, body)

    def _set_ticket(self, connection: ServerConnection, request: Request, response: Response) -> None:
        """Set a new ticket in the response that opens a connection, so that the page can connect again."""
        if response.status_code == http.HTTPStatus.SWITCHING_PROTOCOLS:
            response.headers["Set-Cookie"] = self._gate.make_cookie()


class Connection(ServerConnection):
    """A connection that returns only valid messages. `is_page`: its request was accepted as that of a page."""

    def __init__(self, *arguments: Any, admission: Admission, **options: Any) -> None:
        """Create a connection whose messages are checked by `admission`; other arguments as in `ServerConnection`."""
        super().__init__(*arguments, **options)
        self._admission = admission
        self._ignored = 0
        self.is_page = False

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Register a new socket; it is closed immediately if `CONNECTIONS_MAX` sockets are open."""
        if len(self._admission.connections) >= CONNECTIONS_MAX:
            self._admission.refusals.add(Refusal.TOO_MANY)
            assert isinstance(transport, asyncio.Transport)
            transport.abort()
        self._admission.connections.add(self)
        super().connection_made(transport)

    def connection_lost(self, exc: Exception | None) -> None:
        """Release the socket."""
        self._admission.connections.discard(self)
        super().connection_lost(exc)

    async def recv(self, decode: bool | None = None) -> Any:
        """Return the next valid message.

        Invalid messages are ignored and counted; `IGNORED_MAX` of them close the connection.
        """
        while True:
            data = await super().recv(decode)
            refusal = self._admission.check_message(data)
            if refusal is None:
                return data
            self._admission.refusals.add(refusal)
            self._ignored += 1
            if self._ignored >= IGNORED_MAX:
                await self.close(POLICY_VIOLATION, "too many invalid messages")
