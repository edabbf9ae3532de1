"""Access routes to an emulated board or hub whose power fails: update the firmware, and check the result."""

from typing import Final, Protocol

from taxel.errors import TaxelError
from taxel.link.virtual import VirtualMemoryLink, VirtualSMBus, VirtualWorld
from taxel.stream import HubClient
from taxel_tools.application import get_firmware_version, wait_for_application
from taxel_tools.errors import HUB
from taxel_tools.files import Firmware
from taxel_tools.firmware_update import Progress, update_board, update_target
from taxel_tools.hub_target import HubTarget
from taxel_tools.scheduler import run
from taxel_tools.wires import BoardWire, HubWire, SmbusWire

BOARD: Final = 0x50
NEIGHBOUR: Final = 0x51
"""Address of the board next to the interrupted one; the hub must continue to poll this board."""
START_TIMEOUT_S: Final = 8.0
RATE_HZ: Final = 20.0


class Route(Protocol):
    """A device in a world and its access route. `address`: address in the world file, or `HUB`."""

    address: int

    def update(self, firmware: Firmware) -> None:
        """Write firmware as `taxel flash` does. Raises `TaxelError`."""
        ...

    def version(self) -> tuple[int, int, int] | None:
        """Return the version of the running application; None if no application starts (bricked)."""
        ...

    def check_hub(self) -> None:
        """Raise `TaxelError` if the hub has stopped polling or does not answer."""
        ...


def ignore_progress(progress: Progress) -> None:
    """Ignore the progress of an update."""


class NeighbourMonitor:
    """Check of the frames of a neighbour board, which keeps its power while another board loses it."""

    def __init__(self, client: HubClient) -> None:
        """Start the hub's stream of frames at `RATE_HZ`."""
        self.client = client
        self.longest_gap_s = 0.0
        self._last_s: float | None = None
        client.set_rate(RATE_HZ)
        client.start()

    def check_frames(self) -> None:
        """Read the new frames of the neighbour board and update `longest_gap_s`.

        Raises `TaxelError` if the hub has restarted or if there is no frame of the board.
        """
        self.client.wait(2.5 / RATE_HZ)  # at least two frames of the board
        times = [frame.time_s for frame in self.client.stream.frames if frame.address == NEIGHBOUR]
        self.client.stream.frames.clear()
        if not self.client.has_handshake or not times:
            raise TaxelError(f"the hub has stopped polling board 0x{NEIGHBOUR:02X}")
        for time_s in times:
            if self._last_s is not None:
                self.longest_gap_s = max(self.longest_gap_s, time_s - self._last_s)
            self._last_s = time_s


class BoardRoute:
    """A board reached through an adapter or the hub; the hub streams throughout."""

    address = BOARD

    def __init__(self, world: VirtualWorld, through_hub: bool) -> None:
        """Connect to an emulated board through the hub or, otherwise, through an I2C adapter.

        The hub polls the boards in both cases.
        """
        self.wire: BoardWire
        link = VirtualMemoryLink(world)
        if through_hub:
            self.wire = HubWire(link)
            client: HubClient = self.wire.hub
        else:
            self.wire = SmbusWire(VirtualSMBus(world), "virtual", lambda: world.now_s, world.run)
            client = HubClient(link)
            client.handshake()
        self.neighbour = NeighbourMonitor(client)

    def update(self, firmware: Firmware) -> None:
        """Write firmware to the board as `taxel flash --board` does."""
        run(self.wire, update_board(BOARD, firmware, self.wire.now_s, ignore_progress))

    def version(self) -> tuple[int, int, int] | None:
        """Return the firmware version of the board from its identity registers; None if no application starts."""
        identity = run(self.wire, wait_for_application(BOARD, self.wire.now_s, START_TIMEOUT_S))
        return None if identity is None else get_firmware_version(identity)

    def check_hub(self) -> None:
        """Check that the hub still polls the neighbour board. Raises `TaxelError` otherwise."""
        self.neighbour.check_frames()


class HubRoute:
    """The hub."""

    address = HUB

    def __init__(self, world: VirtualWorld) -> None:
        """Connect to the emulated hub over its UART."""
        self._link = VirtualMemoryLink(world)

    def update(self, firmware: Firmware) -> None:
        """Write firmware to the hub as `taxel flash --hub` does; ends when the hub polls its boards."""
        target = HubTarget(self._link)
        run(target.wire, update_target(target, firmware, ignore_progress))

    def version(self) -> tuple[int, int, int] | None:
        """Return the firmware version of the hub from its handshake; None if no application starts."""
        target = HubTarget(self._link)
        return run(target.wire, target.wait_for_application(START_TIMEOUT_S))

    def check_hub(self) -> None:
        """Check that the hub polls its boards. Raises `TaxelError` otherwise."""
        target = HubTarget(self._link)
        target.polled_addresses = [BOARD]
        run(target.wire, target.check_operation())
