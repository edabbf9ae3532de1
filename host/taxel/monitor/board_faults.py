"""Fault records of boards that have restarted while the monitor runs."""

from contextlib import suppress
from typing import Any

from taxel.skin import Skin
from taxel.stream.hub_client import HubError
from taxel_protocol.names import BoardFault


class BoardFaults:
    """Reads the fault record of each board that the hub reports as restarted, and describes the latest fault."""

    def __init__(self, skin: Skin) -> None:
        """Create the state of a monitor of an open skin, without a fault."""
        self._skin = skin
        self._last: dict[str, Any] | None = None
        self.latest: str | None = None

    def update(self) -> str | None:
        """Read the records of boards that have restarted since the last call; returns the latest fault in one line.

        None without a fault. A recording has no fault records, as nothing can be read from its boards.
        """
        if self._skin.link.is_recorded:
            return None
        for address in self._take_restarted():
            with suppress(HubError):  # the board does not answer yet, or has no power: a later restart is read again
                record = self._skin.hub.read_board_fault(address)
                if record is not None:
                    self.latest = f"board 0x{address:02X} has restarted: {record.describe()}"
        return self.latest

    def _take_restarted(self) -> list[int]:
        """Addresses of the boards that were reported as restarted since the last call."""
        messages = []
        for message in reversed(self._skin.hub.faults):
            if message is self._last:
                break
            messages.append(message)
        if messages:
            self._last = messages[0]
        return sorted({message["address"] for message in messages if message["fault"] == BoardFault.RESTARTED})
