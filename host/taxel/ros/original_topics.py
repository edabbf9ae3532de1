"""Topics of the original ROS stack: one topic for each board, with the message type TactileData.

The original stack publishes `sensor_8_readings` to `sensor_29_readings`; the number is the I2C address of the board. A
message carries the raw counts of one board, the clock of the hub in milliseconds and the number of the board. Source:
package bici_ros_sensor_reader of the public repository BICI_SENSORS_ROS.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np

from taxel.errors import TaxelError
from taxel.hand import Hand
from taxel.ros.topics import TopicMessage
from taxel.stream import TaxelFrame

ORIGINAL_TYPE = "bici_ros_sensor_reader/TactileData"
"""Type of the messages, with the package of the final original stack."""

ORIGINAL_HAND = "original"
COMPLETE_HAND = "original_complete"
THUMB_ADDRESSES = frozenset(range(16, 21))
"""Addresses of the thumb's boards, which only the hand `original_complete` has."""

_US_PER_MS = 1000
_NS_PER_S = 1_000_000_000
_UINT32 = 1 << 32
_COUNT_MAX = 65_535


class OriginalMessageError(TaxelError):
    """Error: a TactileData message does not contain raw counts of a board."""


def make_original_topic(address: int) -> str:
    """Return the topic of the board with an I2C address, such as `/sensor_8_readings`."""
    return f"/sensor_{address}_readings"


class OriginalTopics:
    """Converter from taxel frames to messages of the original ROS stack, one message for each frame.

    The field `timestamp` is the hub's clock in milliseconds. The 32-bit microseconds of the frames are unwrapped, so
    that the milliseconds do not jump after 71 minutes.
    """

    def __init__(self, hand: Hand, epoch_offset_ns: int = 0) -> None:
        """Create a converter from taxel frames to messages of the original ROS stack.

        epoch_offset_ns: Unix time minus stream time, nanoseconds.
        """
        self._topics = {board.address: make_original_topic(board.address) for board in hand.boards}
        self._offset_ns = epoch_offset_ns
        self._last_us: int | None = None

    def take(self, frame: TaxelFrame) -> Iterator[TopicMessage]:
        """Yield the message of a taxel frame."""
        message = {
            "data": frame.raw_counts.astype(np.float32),
            "timestamp": self._unwrap(frame.hub_time_us) // _US_PER_MS % _UINT32,
            "sensor_num": frame.address,
        }
        time_ns = round(frame.time_s * _NS_PER_S) + self._offset_ns
        yield TopicMessage(self._topics[frame.address], ORIGINAL_TYPE, time_ns, message)

    def finish(self) -> Iterator[TopicMessage]:
        """Yield the remaining messages after the last frame: none, because each frame is one message."""
        return iter(())

    def _unwrap(self, time_us: int) -> int:
        """Convert a 32-bit time of the hub, microseconds, to a time that continues after a wrap of the 32 bits.

        The value that is nearest to the last time is returned, so a time may be up to 35 minutes before the last one.
        """
        last = time_us if self._last_us is None else self._last_us
        self._last_us = last + (time_us - last + _UINT32 // 2) % _UINT32 - _UINT32 // 2
        return self._last_us


class OriginalFrames:
    """Converter from TactileData messages, in order of arrival, to taxel frames.

    The original messages have no cycle and no sequence number. A new poll cycle begins when a board sends a second
    message; a board without a message in a cycle is counted as missing. The sequence number equals the cycle.
    """

    def __init__(self) -> None:
        """Create a converter at its first poll cycle."""
        self._cycle = 0
        self._addresses: set[int] = set()

    def convert(self, message: Any, time_ns: int) -> TaxelFrame:
        """Return the taxel frame of a message with the fields data, timestamp and sensor_num.

        A new poll cycle begins when a board sends a second message; the sequence number equals the cycle. time_ns: time
        of arrival, nanoseconds. Raises OriginalMessageError for values that are not raw counts.
        """
        data = np.asarray(message.data, np.float64)
        is_count = (data >= 0) & (data <= _COUNT_MAX) & (data == np.trunc(data))
        if not is_count.all():
            index = int(np.argmin(is_count))
            expected = f"integers from 0 to {_COUNT_MAX}"
            raise OriginalMessageError(
                f"board {message.sensor_num}, value {index}: expected raw counts, {expected}, found {data[index]:g}"
            )
        address = int(message.sensor_num)
        if address in self._addresses:
            self._cycle += 1
            self._addresses.clear()
        self._addresses.add(address)
        cycle, time_us = self._cycle % (1 << 16), int(message.timestamp) * _US_PER_MS % _UINT32
        return TaxelFrame(address, cycle, cycle, time_ns / _NS_PER_S, time_us, time_us, data.astype(np.uint16))
