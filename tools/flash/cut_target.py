"""Ways to an emulated board or hub whose power fails: a command that may be given again, a look at what came of it."""

from __future__ import annotations

from typing import Final, Protocol

from taxel.errors import TaxelError
from taxel.link.virtual import VirtualMemoryLink, VirtualSMBus, VirtualWorld
from taxel.stream import HubClient
from taxel_tools.application import version_of, wait_for_application
from taxel_tools.errors import HUB
from taxel_tools.files import Firmware
from taxel_tools.hub_target import HubTarget
from taxel_tools.interleave import run
from taxel_tools.program import Progress, update, update_target
from taxel_tools.wires import BoardWire, HubWire, SmbusWire

BOARD: Final = 0x50
BESIDE: Final = 0x51
"""The board beside the one that is cut: the hub must go on polling it."""
PATIENCE_S: Final = 8.0
RATE_HZ: Final = 20.0


class Way(Protocol):
    """A device in a world, and how it is reached. `address` is that of the world file, or `HUB`."""

    address: int

    def update(self, firmware: Firmware) -> None:
        """Give it firmware, as `taxel flash` does. Raises `TaxelError`."""
        ...

    def version(self) -> tuple[int, int, int] | None:
        """Of the application that runs; None if none comes up: bricked."""
        ...

    def check_hub(self) -> None:
        """Raises `TaxelError` if the hub has not gone on polling, or does not answer."""
        ...


def ignore(progress: Progress) -> None:
    """Nobody watches."""


class Beside:
    """The hub polls its boards while one of them is cut: what is seen of the others."""

    def __init__(self, client: HubClient) -> None:
        self.client = client
        self.longest_gap_s = 0.0
        self._last_s: float | None = None
        client.set_rate(RATE_HZ)
        client.start()

    def look(self) -> None:
        """Take in the frames that have come. Raises `TaxelError` if the hub was restarted or a board is missing."""
        self.client.wait(2.5 / RATE_HZ)
        times = [frame.time_s for frame in self.client.stream.frames if frame.address == BESIDE]
        self.client.stream.frames.clear()
        if not self.client.is_greeted or not times:
            raise TaxelError(f"the hub has not gone on polling board 0x{BESIDE:02X}")
        for time_s in times:
            if self._last_s is not None:
                self.longest_gap_s = max(self.longest_gap_s, time_s - self._last_s)
            self._last_s = time_s


class BoardWay:
    """A board through an adapter or the hub; the hub streams all the while."""

    address = BOARD

    def __init__(self, world: VirtualWorld, through_hub: bool) -> None:
        self.wire: BoardWire
        link = VirtualMemoryLink(world)
        if through_hub:
            self.wire = HubWire(link)
            client: HubClient = self.wire.hub
        else:
            self.wire = SmbusWire(VirtualSMBus(world), "virtual", lambda: world.now_s, world.run)
            client = HubClient(link)
            client.greet()
        self.beside = Beside(client)

    def update(self, firmware: Firmware) -> None:
        """`taxel flash --board`."""
        run(self.wire, update(BOARD, firmware, self.wire.now_s, ignore))

    def version(self) -> tuple[int, int, int] | None:
        """By its identity registers."""
        identity = run(self.wire, wait_for_application(BOARD, self.wire.now_s, PATIENCE_S))
        return None if identity is None else version_of(identity)

    def check_hub(self) -> None:
        """The board beside is polled on."""
        self.beside.look()


class HubWay:
    """The hub itself."""

    address = HUB

    def __init__(self, world: VirtualWorld) -> None:
        self._link = VirtualMemoryLink(world)

    def update(self, firmware: Firmware) -> None:
        """`taxel flash --hub`; it ends with the hub polling its boards."""
        target = HubTarget(self._link)
        run(target.wire, update_target(target, firmware, ignore))

    def version(self) -> tuple[int, int, int] | None:
        """By its greeting."""
        target = HubTarget(self._link)
        return run(target.wire, target.wait_for_application(PATIENCE_S))

    def check_hub(self) -> None:
        """It polls its boards."""
        target = HubTarget(self._link)
        target.boards = [BOARD]
        run(target.wire, target.settle())
