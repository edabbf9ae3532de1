"""Reader thread that moves bytes from a link into a ring buffer, so that a slow consumer loses no bytes."""

import threading

from taxel.link import Link
from taxel.stream.ring import RingBuffer

_READ_TIMEOUT_S = 0.1


class Pump:
    """Thread that reads `link` into a ring buffer until the link ends or `stop()` is called.

    A failure of the link is passed to the reader of the ring buffer.
    """

    def __init__(self, link: Link, ring: RingBuffer) -> None:
        """Start a thread that reads `link` and writes the bytes into `ring`."""
        self._link = link
        self._ring = ring
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name=f"pump {link.name}", daemon=True)
        self._thread.start()

    def _run(self) -> None:
        """Read the link and write its chunks into the ring buffer, until `stop` is called or the link fails."""
        try:
            while not self._stopping.is_set():
                chunk = self._link.read(_READ_TIMEOUT_S)
                if chunk is not None:
                    self._ring.write(chunk)
        except BaseException as failure:
            self._ring.fail(failure)

    def stop(self) -> None:
        """Stop the reader thread and wait for its end."""
        self._stopping.set()
        self._ring.close()
        self._thread.join()
