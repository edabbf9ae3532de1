"""Which taxel frames of a batch can be used, and when their scans began on the host's clock."""

from collections.abc import Callable, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from taxel.stream.clock import ClockMap
from taxel.stream.decoder import BOARD_CRC_BAD, HUB_RESTARTED, NO_REFERENCE, Batch
from taxel.stream.frames import HubMessage, messages_of
from taxel_protocol import FrameType


class RowClock:
    """Feeds a `ClockMap` from batches, in order, and asks it for the times. Messages go to `on_message`."""

    def __init__(self, clock: ClockMap, on_message: Callable[[HubMessage], None]) -> None:
        self.clock = clock
        self._on_message = on_message

    def take(
        self, batch: Batch, ends: Sequence[int] | NDArray[np.uint64], times_ns: Sequence[int] | NDArray[np.uint64]
    ) -> Iterator[tuple[NDArray[np.void], NDArray[np.float64]]]:
        """(rows, seconds) of usable taxel frames, in parts that end where the hub was restarted: its clock begins anew.

        `ends`, `times_ns` [r]: up to which byte of the stream what arrived together went, and when it arrived.
        """
        messages = messages_of(batch)
        others, first_taxel, first_other = batch.others, 0, 0
        restarts = others["stream_position"][(others["flags"] & HUB_RESTARTED) != 0] if len(others) else ()
        for cut in [*restarts, None]:
            last_taxel, last_other = (_rows_before(rows, cut) for rows in (batch.taxels, others))
            taxels = batch.taxels[first_taxel:last_taxel]
            arrivals_s = _arrivals_s(taxels, ends, times_ns)
            own = slice(first_other, last_other)
            usable = self._take_part(taxels, arrivals_s, others[own], messages[own])
            if len(usable):
                yield usable, self.clock.host_times_s(self.clock.hub_times_us(usable))
            first_taxel, first_other = last_taxel, last_other

    def _take_part(
        self,
        taxels: NDArray[np.void],
        arrivals_s: NDArray[np.float64],
        others: NDArray[np.void],
        messages: list[HubMessage],
    ) -> NDArray[np.void]:
        for message in messages:
            self.clock.take_message(message)
            self._on_message(message)
        which = [place for place, message in enumerate(messages) if message.type is FrameType.TIME_SYNC]
        sync_us = [messages[place].fields["hub_time_us"] for place in which]
        self.clock.take_arrivals(taxels, arrivals_s, others[which] if which else others[:0], sync_us)
        useless = taxels["flags"] & (BOARD_CRC_BAD | NO_REFERENCE)
        return taxels[useless == 0] if useless.any() else taxels


def _rows_before(rows: NDArray[np.void], cut: np.uint64 | None) -> int:
    """How many of `rows` ended before byte `cut` of the stream; None: all."""
    return len(rows) if cut is None else int(np.searchsorted(rows["stream_position"], cut))


def _arrivals_s(
    taxels: NDArray[np.void], ends: Sequence[int] | NDArray[np.uint64], times_ns: Sequence[int] | NDArray[np.uint64]
) -> NDArray[np.float64]:
    if not len(ends):
        return np.zeros(len(taxels))
    index = np.searchsorted(ends, taxels["stream_position"], side="left")
    return np.asarray(times_ns)[np.minimum(index, len(ends) - 1)] * 1e-9
