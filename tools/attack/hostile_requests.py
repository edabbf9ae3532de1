"""Hostile requests to the page of a monitor: foreign pages, foreign names, missing and old tokens, replays, bytes."""

import random
import secrets
from collections.abc import Awaitable, Callable
from dataclasses import replace

from page_client import SUBPROTOCOL, Request, Response, open_page, send, send_bytes

ACCEPTED = (101, 200)
"""Status codes of an admitted request."""

FOREIGN_ORIGINS = (
    "http://evil.example",
    "null",
    "https://{host}",
    "http://{address}:{other}",
    "http://{host}.evil.example",
    "",
)
FOREIGN_HOSTS = (
    "evil.example", "evil.example:{port}", "{address}.evil.example:{port}", "127.0.0.1:{port}@evil.example",
    "0.0.0.0:{port}", "[::1]:{port}", "127.0.0.1:{port}:{port}", "127.0.0.1:x", " ", "2130706433:{port}",
)  # fmt: skip
Attack = Callable[[Request, random.Random], Awaitable[Response]]


def _fill(template: str, page: Request) -> str:
    """Insert the names and ports of the page into a template such as `FOREIGN_HOSTS`."""
    return template.format(host=page.authority, address=page.address, port=page.port, other=page.port % 65535 + 1)


async def _load(page: Request) -> str:
    """Load the page as its user does, and return its cookie.

    A foreign page in the same browser has this cookie at best.
    """
    return (await send(page)).cookie


async def attack_origin(page: Request, rng: random.Random) -> Response:
    """Request or connection of a page of a foreign origin, with a valid token and a valid ticket."""
    origin = _fill(rng.choice(FOREIGN_ORIGINS), page)
    if origin and rng.random() < 0.3:
        return await send(page.with_headers(("Origin", origin)))
    return await send(page.as_connection(await _load(page), origin))


async def attack_host(page: Request, rng: random.Random) -> Response:
    """Request or connection to a foreign name that is resolved to this computer (DNS rebinding)."""
    host = _fill(rng.choice(FOREIGN_HOSTS), page)
    if rng.random() < 0.5:
        return await send(replace(page, host=host))
    return await send(replace(page.as_connection(await _load(page), f"http://{host}"), host=host))


async def attack_without_token(page: Request, rng: random.Random) -> Response:
    """Request or connection without a token, with an empty one, or with a random cookie."""
    target = rng.choice(
        ("/", "/?token=", "/?token", "/index.html", "/?token=&token=", "/../../etc/passwd", "/%2e%2e/x")
    )
    cookie = rng.choice(("", "taxel=x", f"taxel_{rng.getrandbits(32):08x}={secrets.token_urlsafe(24)}", "a=b; c"))
    if rng.random() < 0.5:
        return await send(replace(page, target=target).with_headers(*([("Cookie", cookie)] if cookie else [])))
    return await send(page.as_connection(cookie))


async def attack_with_old_token(page: Request, rng: random.Random) -> Response:
    """Request with the token of another run, or with the token of this run changed in one character."""
    token = secrets.token_urlsafe(24)
    if rng.random() < 0.5:
        place = rng.randrange(len(page.token))
        token = page.token[:place] + ("A" if page.token[place] != "A" else "B") + page.token[place + 1 :]
    target = rng.choice((f"/?token={token}", f"/?token={token}&token={page.token}", f"/?token={page.token}x"))
    return await send(replace(page, target=target))


async def attack_with_replay(page: Request, rng: random.Random) -> Response:
    """Send the request of an admitted connection a second time: byte for byte, or as another program would send it."""
    request = page.as_connection(await _load(page))
    first = await send(request)
    assert first.status == 101, first
    if rng.random() < 0.5:
        request = replace(request, headers=tuple(h for h in request.headers if h[0] != "Sec-WebSocket-Key"))
        request = request.with_headers(("Sec-WebSocket-Key", "dGhlIHNhbXBsZSBub25jZQ=="))
    return await send(request)


async def attack_with_bytes(page: Request, rng: random.Random) -> Response:
    """Send an oversized or malformed request: long lines, many headers, other methods, bodies, random bytes."""
    size = rng.choice((10_000, 70_000, 1_000_000))
    cases = (
        replace(page, target=f"/?token={'x' * size}").encode(),
        page.with_headers(*((f"X-{n}", "y") for n in range(400))).encode(),
        page.with_headers(("X-Long", "z" * size)).encode(),
        replace(page, method=rng.choice(("POST", "PUT", "DELETE", "OPTIONS", "TRACE", "get", "\x00"))).encode(),
        page.with_headers(("Content-Length", str(size))).encode() + b"u" * size,
        page.with_headers(("Transfer-Encoding", "chunked")).encode() + b"5\r\nhello\r\n0\r\n\r\n",
        page.encode().replace(b"HTTP/1.1", rng.choice((b"HTTP/9.9", b"", b"HTTP/1.1 x"))),
        page.with_headers(("Host", "evil.example")).encode(),
        rng.randbytes(rng.randrange(1, 2000)) + b"\r\n\r\n",
    )
    return await send_bytes(page.address, page.port, rng.choice(cases))


async def attack_as_other_program(page: Request, rng: random.Random) -> Response:
    """Request a connection as another program or version of the page, with a valid ticket."""
    names = ("", "viser", "viser-v0", f"{SUBPROTOCOL}x", "[bold red]x[/]", "\x1b[2J")
    return await send(page.as_connection(await _load(page), subprotocol=rng.choice(names)))


REQUESTS: dict[str, Attack] = {
    "foreign origin": attack_origin,
    "foreign host": attack_host,
    "no token": attack_without_token,
    "old token": attack_with_old_token,
    "replayed": attack_with_replay,
    "malformed or oversized request": attack_with_bytes,
    "other program": attack_as_other_program,
}

__all__ = ["ACCEPTED", "REQUESTS", "open_page"]
