"""Live source of the original ROS topics: a link whose frames come from a ROS node."""

import queue
import time
from collections.abc import Iterator
from typing import Any
from urllib.parse import parse_qs

from taxel.hand import Hand
from taxel.link import Chunk, LinkError
from taxel.ros.node import Node, open_node
from taxel.ros.original_topics import (
    ORIGINAL_HAND,
    ORIGINAL_TYPE,
    OriginalFrames,
    OriginalMessageError,
    make_original_topic,
)
from taxel.stream import TaxelFrame
from taxel.stream.encoder import FramesLink

NODE_NAME = "taxel_reader"
ADDRESSES = range(8, 30)
"""Addresses of the original topics."""

QUEUE_LENGTH = 1000
"""Largest number of messages, of all boards, that wait for the reader of the link: as many as the original publisher
keeps for one topic."""


class OriginalTopicsLink(FramesLink):
    """A read-only link of the messages that arrive on the original topics.

    The link ends after ROS has shut the node down. A reader that is too slow loses the oldest messages.
    """

    is_real_time = True
    has_arrivals = True

    def __init__(self, name: str, node: Node) -> None:
        """Subscribe to all original topics. name: for messages. node: closed together with the link."""
        self._node = node
        self._messages: queue.SimpleQueue[tuple[Any, int]] = queue.SimpleQueue()
        self._converter = OriginalFrames()
        super().__init__(name, self._receive())
        self.header = {"hand": ORIGINAL_HAND}
        for address in ADDRESSES:
            node.listen(make_original_topic(address), ORIGINAL_TYPE, self._store)

    def _store(self, message: Any) -> None:
        """Store a message with its time of arrival; called in the thread of the subscription.

        If `QUEUE_LENGTH` messages wait for the reader, the oldest one is discarded.
        """
        while self._messages.qsize() >= QUEUE_LENGTH:
            self._messages.get()
        self._messages.put((message, time.monotonic_ns()))

    def read(self, timeout_s: float = 0.0) -> Chunk | None:
        """Return the next message, encoded as bytes of a hub; None if no message arrives within `timeout_s` seconds.

        Raises EOFError after ROS has shut the node down and all messages were read.
        """
        deadline_s = time.monotonic() + timeout_s
        while self._messages.empty():
            if not self._node.is_alive:
                raise EOFError
            remaining_s = deadline_s - time.monotonic()
            if remaining_s <= 0.0:
                return None
            self._node.wait(min(remaining_s, 0.01))
        return super().read()

    def _receive(self) -> Iterator[TaxelFrame]:
        """Yield one taxel frame for each stored message. Raises LinkError for a message without raw counts."""
        while True:
            message, time_ns = self._messages.get()
            try:
                yield self._converter.convert(message, time_ns)
            except OriginalMessageError as error:
                raise LinkError(self.name, str(error)) from None

    def close(self) -> None:
        """Shut the ROS node down."""
        super().close()
        self._node.close()


def open_original_topics(url: str, hand: Hand | None = None) -> OriginalTopicsLink:
    """Open the original topics of a running ROS as a link: `ros:original`, or `ros:original?version=1`.

    hand: not used; the default hand of the link is `original`. Raises `LinkError` for another URL, and `RosError` if
    ROS is not installed or no ROS master answers.
    """
    head, _, query = url.partition("?")
    options = parse_qs(query, keep_blank_values=True)
    version = options.pop("version", [None])[-1]
    if head != "ros:original" or options or version not in (None, "1", "2"):
        raise LinkError(url, "is not a ROS source; expected ros:original, ros:original?version=1 or ?version=2")
    return OriginalTopicsLink(url, open_node(None if version is None else int(version), NODE_NAME))
