"""The link to a hub that this process executes on an I2C adapter."""

from __future__ import annotations

import ctypes
import errno
import os
import select
import threading
import time
from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

from taxel.link.base import Chunk
from taxel.link.errors import LinkError, PortVanishedError
from taxel.link.linux_hub.native import load_linux_hub, make_settings
from taxel_protocol.limits import SNAPSHOT_OVERHEAD, TAXELS_MAX

if TYPE_CHECKING:
    import smbus2

READ_SIZE: Final = 1 << 16
WRITE_TIMEOUT_S: Final = 2.0
RETRY_S: Final = 0.001
"""Pause before the next attempt to write to a full buffer, seconds; the hub processes 256 bytes in less time."""


class LinuxHubLink:
    """The byte stream of a hub whose firmware a thread of this process executes on an I2C adapter.

    The thread is native code: it does not wait for Python. `scl_hz`: clock of the bus, Hz.
    """

    is_real_time = True
    is_recorded = False
    has_flow_control = True
    baud = 1e9
    """There is no UART: bytes arrive at once."""

    def __init__(self, bus: smbus2.SMBus, device: str, scl_hz: float, addresses: Sequence[int]) -> None:
        """Start the hub on an open adapter, which the link closes.

        device: path of the adapter, for messages. scl_hz: clock of the bus, Hz. addresses: I2C addresses at which
        boards are searched. Raises `LinkError` if the thread cannot be started.
        """
        self.name = device
        self.scl_hz = scl_hz
        self._bus = bus
        self._library = load_linux_hub()
        self._buffer = ctypes.create_string_buffer(READ_SIZE)
        self._lock = threading.Lock()  # close() ends the thread while another Python thread may read
        settings = make_settings(scl_hz, addresses)
        self._thread: int | None = self._library.hub_thread_start(bus.fd, ctypes.byref(settings))
        if not self._thread:
            bus.close()
            raise LinkError(device, f"the hub cannot be started ({os.strerror(ctypes.get_errno())})")
        self._fd = int(self._library.hub_thread_fd(self._thread))

    def read(self, timeout_s: float) -> Chunk | None:
        """Return the next bytes of the hub; None if none arrives within `timeout_s` seconds.

        Raises `PortVanishedError` after a failure of the adapter, once all bytes from before the failure are returned.
        """
        if self._thread is None:
            raise LinkError(self.name, "the link is closed")
        if not select.select([self._fd], [], [], timeout_s)[0]:
            return None
        with self._lock:
            if self._thread is None:
                return None
            size = self._library.hub_thread_receive(self._thread, self._buffer, READ_SIZE)
            arrival_ns = time.monotonic_ns()
            if size:
                return Chunk(ctypes.string_at(self._buffer, size), arrival_ns)
            failure = int(self._library.hub_thread_failure(self._thread))
        if failure:
            raise PortVanishedError(self.name, _describe_failure(failure))
        return None

    def write(self, data: bytes) -> None:
        """Send bytes to the hub.

        Raises `LinkError` if the hub accepts no byte for 2 s, or if the adapter has failed.
        """
        deadline = time.monotonic() + WRITE_TIMEOUT_S
        while data:
            with self._lock:
                if self._thread is None:
                    raise LinkError(self.name, "the link is closed")
                sent = self._library.hub_thread_send(self._thread, data, len(data))
                failure = int(self._library.hub_thread_failure(self._thread))
            if failure:
                raise PortVanishedError(self.name, _describe_failure(failure))
            data = data[sent:]
            if sent:
                deadline = time.monotonic() + WRITE_TIMEOUT_S
            if data:
                if time.monotonic() > deadline:
                    raise LinkError(self.name, "the hub accepts no bytes; a transfer on the bus does not end")
                time.sleep(RETRY_S)

    def close(self) -> None:
        """Stop the hub after the transfer in progress, and close the adapter."""
        with self._lock:
            thread, self._thread = self._thread, None
            if thread is not None:
                self._library.hub_thread_stop(thread)
                self._bus.close()


def _describe_failure(failure: int) -> str:
    """Return the message for the error number (errno) with which an adapter has failed, with a remedy."""
    if failure in (errno.EOPNOTSUPP, errno.EINVAL):
        return (
            f"the adapter rejects a transfer of the boards ({os.strerror(failure)}); use an adapter that reads "
            f"{SNAPSHOT_OVERHEAD + 2 * TAXELS_MAX} bytes at a time"
        )
    return f"the adapter is gone ({os.strerror(failure)}); check its plug and its driver"
