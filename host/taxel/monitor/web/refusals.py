"""Counts of refused requests and messages; the first of each kind is reported."""

import threading
from collections import Counter
from collections.abc import Callable

from taxel.monitor.web.gate import Refusal

MESSAGE_REFUSALS = frozenset({Refusal.MALFORMED, Refusal.UNKNOWN_CONTROL, Refusal.UNKNOWN_VALUE})
"""Refusals of messages; the others are refusals of requests."""


class Refusals:
    """Counter of refusals.

    The reported texts contain no part of a request, because its characters could control the terminal.
    """

    def __init__(self, report: Callable[[str], None]) -> None:
        """Create a counter; report: called with one line for the first refusal of each kind, from any thread."""
        self._report = report
        self._counts: Counter[Refusal] = Counter()
        self._lock = threading.Lock()

    def add(self, refusal: Refusal) -> None:
        """Count a refusal, and report it if it is the first of its kind."""
        with self._lock:
            self._counts[refusal] += 1
            is_first = self._counts[refusal] == 1
        if is_first:
            self._report(f"page: refused {refusal.value}; further ones are only counted")

    @property
    def counts(self) -> dict[Refusal, int]:
        """Numbers of refusals by kind; kinds without a refusal are missing."""
        with self._lock:
            return dict(self._counts)

    @property
    def summary(self) -> str:
        """One line with the numbers of refused requests and of ignored messages."""
        counts = self.counts
        messages = sum(count for refusal, count in counts.items() if refusal in MESSAGE_REFUSALS)
        requests = sum(counts.values()) - messages
        return f"{requests} request{'s' * (requests != 1)} refused, {messages} message{'s' * (messages != 1)} ignored"

    @property
    def total(self) -> int:
        """Number of all refusals."""
        return sum(self.counts.values())
