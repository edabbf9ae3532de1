"""Fault records of boards that have restarted while the monitor runs. A board stores a record before it restarts."""

from contextlib import suppress
from typing import Any

from taxel.skin import Skin
from taxel.stream.hub_client import HubError
from taxel_protocol.names import BoardFault


class BoardFaults:
    """Reader of the fault record of each board that the hub reports as restarted.

    The attribute `latest` describes the latest fault in one line; None without a fault.
    """

    def __init__(self, skin: Skin) -> None:
        """Create a reader for the boards of an open skin."""
        self._skin = skin
        self._last: dict[str, Any] | None = None
        self.latest: str | None = None

    def update(self) -> str | None:
        """Read the records of the boards that have restarted since the last call, and return the latest fault.

        Returns the fault in one line; None without a fault, and for a recording, whose boards cannot be read.
        """
        if self._skin.link.is_recorded:
            return None
        for address in self._take_restarted():
            with suppress(HubError):  # the board does not answer; its record is read after its next restart
                record = self._skin.hub.read_board_fault(address)
                if record is not None:
                    self.latest = f"board 0x{address:02X} has restarted: {record.describe()}"
        return self.latest

    def _take_restarted(self) -> list[int]:
        """Return the addresses of the boards that the hub has reported as restarted since the last call, sorted."""
        messages = []
        for message in reversed(self._skin.hub.faults):
            if message is self._last:
                break
            messages.append(message)
        if messages:
            self._last = messages[0]
        return sorted({message["address"] for message in messages if message["fault"] == BoardFault.RESTARTED})
