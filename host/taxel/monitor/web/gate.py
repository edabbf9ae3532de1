"""Checks of the requests for the monitor's page: host name, origin of the page, token and tickets."""

import hmac
import secrets
from collections import OrderedDict
from collections.abc import Sequence
from enum import Enum
from http.cookies import CookieError, SimpleCookie
from typing import Final, Protocol
from urllib.parse import parse_qs, urlsplit

LOOPBACK_NAMES: Final = frozenset({"127.0.0.1", "localhost"})
"""Names under which a browser may address the page. Any other name in the header Host means that a foreign name was
resolved to this computer (DNS rebinding). The port is not compared, because a tunnel (`ssh -L`) may have another one.
"""

TOKEN_BYTES: Final = 24
"""Number of random bytes of a token or ticket: 192 bits, which cannot be found by trial."""

TICKETS_MAX: Final = 4096
"""Largest number of unused tickets. The oldest is discarded, so that requests cannot exhaust memory; its page must be
loaded again before it can connect.
"""


class Refusal(Enum):
    """Why a request or a message of a page is refused; the value is the text for the user."""

    FOREIGN_HOST = "a request to a foreign host name"
    FOREIGN_ORIGIN = "a request from a page of a foreign origin"
    NO_TOKEN = "a request without the token of this run"
    NOT_FOUND = "a request for another path than the page"
    OTHER_CLIENT = "a connection of another program or version of the page"
    TOO_MANY = "a connection above the largest number of pages"
    MALFORMED = "a message that is no valid message of the page"
    UNKNOWN_CONTROL = "a message for a control that the page does not have"
    UNKNOWN_VALUE = "a message with a value that its control does not have"


class Headers(Protocol):
    """Headers of a request; a name may occur several times."""

    def get_all(self, name: str) -> Sequence[str]:
        """Return all values of the header `name`; its case does not matter."""
        ...


class Gate:
    """Checks that a request comes from a page that was opened with the address that the program printed.

    The address contains a random token, which is valid until the program ends. A ticket is a random string that permits
    one connection: each response with the page sets a new ticket in a cookie, and each connection of a page consumes
    its ticket. A recorded request is therefore refused when it is repeated. Foreign pages can neither read the cookie
    (HttpOnly) nor send it (SameSite), and requests with their origin are refused.
    """

    def __init__(self) -> None:
        """Create a gate with a new random token and no tickets."""
        self.token = secrets.token_urlsafe(TOKEN_BYTES)
        self._cookie = f"taxel_{secrets.token_hex(4)}"  # browsers share the cookies of all ports of a host
        self._tickets: OrderedDict[str, None] = OrderedDict()

    def check_page(self, path: str, headers: Headers) -> Refusal | None:
        """Return why a request for the page is refused; None if the request is accepted.

        path: target of the request with its query, which contains the token (the secret of this run). A request without
        the token is accepted with a ticket (a secret cookie for one connection), which is not consumed.
        """
        if (refusal := self._check_names(headers, needs_origin=False)) is not None:
            return refusal
        try:
            parts = urlsplit(path)
        except ValueError:
            return Refusal.NOT_FOUND
        tokens = parse_qs(parts.query, max_num_fields=16).get("token", []) if _has_few_fields(parts.query) else []
        has_token = len(tokens) == 1 and hmac.compare_digest(tokens[0].encode(), self.token.encode())
        if not has_token and self._find_ticket(headers) is None:
            return Refusal.NO_TOKEN
        return None if parts.path == "/" else Refusal.NOT_FOUND

    def check_connection(self, path: str, headers: Headers) -> Refusal | None:
        """Return why the connection of a page is refused; None if it is accepted.

        A connection needs a ticket: a secret of one use, which the response with the page sets as a cookie. The caller
        must call `consume_ticket` for an accepted connection.
        """
        if (refusal := self._check_names(headers, needs_origin=True)) is not None:
            return refusal
        if self._find_ticket(headers) is None:
            return Refusal.NO_TOKEN
        return None if path.partition("?")[0] == "/" else Refusal.NOT_FOUND

    def consume_ticket(self, headers: Headers) -> None:
        """Make the ticket in the cookies of an accepted connection invalid: a ticket permits one connection."""
        ticket = self._find_ticket(headers)
        if ticket is not None:
            del self._tickets[ticket]

    def make_cookie(self) -> str:
        """Create a ticket, and return the value of the header Set-Cookie that contains it.

        A ticket is a random string that permits one connection.
        If there are `TICKETS_MAX` unused tickets, the oldest one becomes invalid.
        """
        ticket = secrets.token_urlsafe(TOKEN_BYTES)
        self._tickets[ticket] = None
        if len(self._tickets) > TICKETS_MAX:
            self._tickets.popitem(last=False)
        return f"{self._cookie}={ticket}; Path=/; HttpOnly; SameSite=Strict"

    def _find_ticket(self, headers: Headers) -> str | None:
        """Return the unused ticket in the cookies of a request; None if there is none."""
        for header in headers.get_all("Cookie"):
            try:
                cookie = SimpleCookie(header).get(self._cookie)
            except CookieError:
                continue
            if cookie is not None and cookie.value in self._tickets:
                return cookie.value
        return None

    @staticmethod
    def _check_names(headers: Headers, needs_origin: bool) -> Refusal | None:
        """Return why a request is refused for its host name or origin; None if both are those of the page.

        needs_origin: whether a request without the header Origin is refused, too.
        """
        hosts, origins = headers.get_all("Host"), headers.get_all("Origin")
        if len(hosts) != 1 or not _is_loopback(hosts[0]):
            return Refusal.FOREIGN_HOST
        if len(origins) > 1 or (needs_origin and not origins):
            return Refusal.FOREIGN_ORIGIN
        return Refusal.FOREIGN_ORIGIN if origins and origins[0].lower() != f"http://{hosts[0].lower()}" else None


def _is_loopback(host: str) -> bool:
    """Whether the value of a header Host is a name of this computer, with or without a port."""
    name, colon, port = host.lower().partition(":")
    return name in LOOPBACK_NAMES and (not colon or (port.isascii() and port.isdecimal() and len(port) <= 5))


def _has_few_fields(query: str) -> bool:
    """Return whether a query has at most the 16 fields that `parse_qs` parses without an error."""
    return query.count("&") < 16
