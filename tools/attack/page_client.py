"""Requests that a page of the monitor makes, each part of which a caller can replace by a hostile one."""

import asyncio
import base64
import secrets
from dataclasses import dataclass, replace
from typing import Any, Self
from urllib.parse import parse_qs, urlsplit

import viser
from websockets.asyncio.client import ClientConnection, connect

SUBPROTOCOL = f"viser-v{viser.__version__}"
RESPONSE_TIMEOUT_S = 20.0
RESPONSE_MAX = 1 << 22


@dataclass(frozen=True)
class Response:
    """Status of a response, 0 if the connection was closed without one, and its text (head and body)."""

    status: int
    text: str = ""

    @property
    def cookie(self) -> str:
        """Cookie that the response sets, as the value of a header Cookie; "" without one."""
        lines = [line for line in self.text.split("\r\n") if line.lower().startswith("set-cookie:")]
        return lines[0].partition(":")[2].partition(";")[0].strip() if lines else ""


@dataclass(frozen=True)
class Request:
    """An HTTP request to the page.

    address, port: where it is sent. target: path and query. headers: (name, value) in addition to Host. host: value of
    the header Host; None for address and port.
    """

    address: str
    port: int
    target: str
    headers: tuple[tuple[str, str], ...] = ()
    host: str | None = None
    method: str = "GET"

    @classmethod
    def of_page(cls, url: str) -> Self:
        """Create the request of a browser that opens `url`."""
        parts = urlsplit(url)
        assert parts.hostname is not None
        assert parts.port is not None
        return cls(parts.hostname, parts.port, f"{parts.path}?{parts.query}" if parts.query else parts.path)

    @property
    def authority(self) -> str:
        """Host name and port of the page, as a browser writes them."""
        return f"{self.address}:{self.port}"

    @property
    def token(self) -> str:
        """Token in the target of the request; "" without one."""
        return parse_qs(urlsplit(self.target).query).get("token", [""])[0]

    def with_headers(self, *headers: tuple[str, str]) -> "Request":
        """Return the request with further headers, given as (name, value)."""
        return replace(self, headers=(*self.headers, *headers))

    def as_connection(self, cookie: str, origin: str | None = None, subprotocol: str = SUBPROTOCOL) -> "Request":
        """Return the request by which a page opens its WebSocket connection.

        cookie: cookie of the loaded page. origin: value of the header Origin; None for the page itself, "" for a
        request without this header.
        """
        origin = f"http://{self.authority}" if origin is None else origin
        headers = [
            ("Upgrade", "websocket"),
            ("Connection", "Upgrade"),
            ("Sec-WebSocket-Key", base64.b64encode(secrets.token_bytes(16)).decode()),
            ("Sec-WebSocket-Version", "13"),
            ("Sec-WebSocket-Protocol", subprotocol),
        ]
        headers += [("Origin", origin)] if origin else []
        headers += [("Cookie", cookie)] if cookie else []
        return replace(self, target="/", headers=tuple(headers))

    def encode(self) -> bytes:
        """Return the bytes of the request as they are sent."""
        lines = [f"{self.method} {self.target} HTTP/1.1", f"Host: {self.host or self.authority}"]
        lines += [f"{name}: {value}" for name, value in self.headers]
        return ("\r\n".join([*lines, "", ""])).encode("latin-1", errors="replace")


async def send_bytes(address: str, port: int, data: bytes) -> Response:
    """Send `data` on a new socket, and return the response; status 0 if the server closes the socket."""
    reader, writer = await asyncio.open_connection(address, port)
    try:
        writer.write(data)
        await writer.drain()
        return await asyncio.wait_for(_read_response(reader), RESPONSE_TIMEOUT_S)
    except (ConnectionError, asyncio.IncompleteReadError):
        return Response(0)
    finally:
        writer.close()


async def send(request: Request) -> Response:
    """Send a request, and return its response."""
    return await send_bytes(request.address, request.port, request.encode())


async def _read_response(reader: asyncio.StreamReader) -> Response:
    """Read the head of a response, which is enough for its status and its cookie."""
    head = (await reader.readuntil(b"\r\n\r\n")).decode("latin-1")
    parts = head.split(" ", 2)
    return Response(int(parts[1]) if len(parts) > 1 and parts[1].isdecimal() else 0, head)


async def open_page(page: Request, **options: Any) -> ClientConnection:
    """Load the page as a browser does, and return its connection.

    options: further options of `websockets.asyncio.client.connect`.
    """
    response = await send(page)
    assert response.status == 200, response
    return await connect(
        f"ws://{page.authority}/", origin=f"http://{page.authority}",  # type: ignore[arg-type]
        additional_headers={"Cookie": response.cookie}, subprotocols=[SUBPROTOCOL],  # type: ignore[list-item]
        compression=None, max_size=None, **options,
    )  # fmt: skip
