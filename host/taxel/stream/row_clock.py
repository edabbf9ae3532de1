"""Selection of the usable taxel frames of a batch, and the host times of their scans."""

from collections.abc import Callable, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from taxel.stream.clock import ClockMap
from taxel.stream.decoder import BOARD_CRC_BAD, HUB_RESTARTED, NO_KEY_FRAME, Batch
from taxel.stream.frames import HubMessage, decode_messages
from taxel_protocol import FrameType


class RowClock:
    """Assigns host times to decoded taxel frames and updates a `ClockMap`; hub messages go to `on_message`."""

    def __init__(self, clock: ClockMap, on_message: Callable[[HubMessage], None]) -> None:
        """Prepare the assignment of host times to decoded frames.

        clock: maps hub times to host times; the frames of each batch update the mapping. on_message: called with each
        hub message.
        """
        self.clock = clock
        self._on_message = on_message

    def take(
        self, batch: Batch, ends: Sequence[int] | NDArray[np.uint64], times_ns: Sequence[int] | NDArray[np.uint64]
    ) -> Iterator[tuple[NDArray[np.void], NDArray[np.float64]]]:
        """Yield (rows, host times in seconds) of the usable taxel frames, divided at restarts of the hub.

        A restart resets the hub's clock. A row (dtype `ROW`) is one taxel frame. `ends`, `times_ns`: end in the stream,
        bytes, and arrival time, nanoseconds, of each received chunk.
        """
        messages = decode_messages(batch)
        message_rows, first_taxel, first_message = batch.message_rows, 0, 0
        is_restart = (message_rows["flags"] & HUB_RESTARTED) != 0
        for end in [*message_rows["stream_position"][is_restart], None]:
            last_taxel, last_message = (_count_rows_before(rows, end) for rows in (batch.taxel_rows, message_rows))
            taxel_rows = batch.taxel_rows[first_taxel:last_taxel]
            arrivals_s = _find_arrivals_s(taxel_rows, ends, times_ns)
            part = slice(first_message, last_message)
            usable = self._update_clock(taxel_rows, arrivals_s, message_rows[part], messages[part])
            if len(usable):
                yield usable, self.clock.host_times_s(self.clock.hub_times_us(usable))
            first_taxel, first_message = last_taxel, last_message

    def _update_clock(
        self,
        taxel_rows: NDArray[np.void],
        arrivals_s: NDArray[np.float64],
        message_rows: NDArray[np.void],
        messages: list[HubMessage],
    ) -> NDArray[np.void]:
        """Update the clock mapping with the frames and messages of one hub start; return the rows of usable frames.

        Frames with a wrong CRC of the board, and delta frames without their key frame, are omitted. arrivals_s: arrival
        time of each taxel frame, seconds.
        """
        for message in messages:
            self.clock.take_message(message)
            self._on_message(message)
        syncs = [index for index, message in enumerate(messages) if message.type is FrameType.TIME_SYNC]
        sync_us = [messages[index].fields["hub_time_us"] for index in syncs]
        self.clock.take_arrivals(taxel_rows, arrivals_s, message_rows[syncs] if syncs else message_rows[:0], sync_us)
        unusable = taxel_rows["flags"] & (BOARD_CRC_BAD | NO_KEY_FRAME)
        return taxel_rows[unusable == 0] if unusable.any() else taxel_rows


def _count_rows_before(rows: NDArray[np.void], position: np.uint64 | None) -> int:
    """Count the rows that end before byte `position` of the stream; None: all rows."""
    return len(rows) if position is None else int(np.searchsorted(rows["stream_position"], position))


def _find_arrivals_s(
    taxel_rows: NDArray[np.void], ends: Sequence[int] | NDArray[np.uint64], times_ns: Sequence[int] | NDArray[np.uint64]
) -> NDArray[np.float64]:
    """Return the arrival time of each of k taxel frames, seconds, f64[k]: that of the chunk in which the frame ends.

    ends: ascending ends of the chunks in the stream, bytes. times_ns: arrival times of the chunks, nanoseconds.
    """
    if not len(ends):
        return np.zeros(len(taxel_rows))
    index = np.searchsorted(ends, taxel_rows["stream_position"], side="left")
    return np.asarray(times_ns)[np.minimum(index, len(ends) - 1)] * 1e-9
