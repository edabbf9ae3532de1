"""An emulated world without a hub: a Linux hub polls its boards through an emulated I2C adapter, in virtual time."""

import ctypes
import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, Final

from taxel.link.errors import LinkError
from taxel.link.linux_hub.native import CLOCK_FUNCTION, TRANSFER_FUNCTION, Bus, load_linux_hub, make_settings
from taxel.link.linux_hub.url import ALL_ADDRESSES
from taxel.link.virtual.world import PS_PER_S, RECEIVE_SIZE, FaultError, VirtualWorld
from taxel_protocol.names import ResetCause

DRIVER_LATENCY_S: Final = 50e-6
"""Time between two transfers of an adapter, seconds: interrupt of the controller, wake-up of the thread and system
call. The value is chosen; a computer with a busy processor needs longer, which lowers the frame rate."""

TIMEOUT_UNIT_S: Final = 0.01
"""Step in which the time limit of a Linux I2C adapter is set, seconds (ioctl I2C_TIMEOUT)."""

_OK, _NACK_ADDRESS, _NACK_DATA = 0, -1, -2
_PS_PER_US: Final = 10**6
_UART_FAULTS: Final = ("up_", "down_")
MIN_STEP_S: Final = 1e-9
"""Shortest step of virtual time, seconds: a shorter step could round to 0, and a wait would never end."""


class VirtualMasterWorld(VirtualWorld):
    """An emulated world whose hub is executed by this process; it has no UART and no hub board.

    The methods are those of `VirtualWorld`. After a failed transfer, the emulated adapter frees the bus as Linux
    drivers do. Faults of the hub act on the hub in this process. A context manager.

    .. warning::
        Not modelled: other programs that use the adapter at the same time, and pauses of the operating system.
    """

    def __init__(
        self,
        world: str,
        *,
        scl_hz: float = 400e3,
        addresses: Iterable[int] = ALL_ADDRESSES,
        latency_s: float = DRIVER_LATENCY_S,
        counts: bool = False,
        files: Mapping[str, Path] | None = None,
    ) -> None:
        """Create the boards of a world file, with an I2C adapter in place of the hub, at virtual time 0.

        scl_hz: clock of the bus in the world file, Hz. addresses: I2C addresses at which the hub searches boards.
        latency_s: time between two transfers, seconds. counts, files: as for `VirtualWorld`. Raises LinkError if the
        emulator rejects the world.
        """
        super().__init__(world, "none", counts=counts, files=files)
        super().inject("hub_unplug")  # the hub that this process executes replaces the hub of the world
        self._latency_s = latency_s
        self._hub_library = load_linux_hub()
        self._is_powered = True
        self._stalled_until_s = 0.0
        self._muted_until_s = 0.0
        self._error: BaseException | None = None
        self._hub_buffer = ctypes.create_string_buffer(RECEIVE_SIZE)
        self._bus = Bus(None, TRANSFER_FUNCTION(self._execute_transfer), CLOCK_FUNCTION(self._read_clock_us))
        start = re.search(r"^hub_clock_start_us (\d+)", world, re.MULTILINE)
        self._settings = make_settings(scl_hz, addresses, int(start[1]) if start else 0)
        self._hub: int | None = self._hub_library.linux_hub_create(
            ctypes.byref(self._settings), ctypes.byref(self._bus)
        )
        if not self._hub:
            raise LinkError("virtual rig", "has no memory for the hub")

    def _read_clock_us(self, _: Any) -> int:
        """Return the virtual time in microseconds. The C code of the hub calls this method."""
        return round(self.now_s * PS_PER_S) // _PS_PER_US

    def _execute_transfer(
        self, _: Any, address: int, write: Any, write_size: int, read: Any, read_size: int, timeout_us: int
    ) -> int:
        """Execute an I2C transfer of the hub on the emulated bus; the C code of the hub calls this method.

        Writes `write_size` bytes to the address, then reads `read_size` bytes of it to `read`. Returns the result (enum
        taxel_i2c_result, 0: success). An exception is stored for `_run_hub`, which raises it; the result is then -4.
        """
        try:
            # As for a Linux adapter, the time limit is rounded up to a multiple of TIMEOUT_UNIT_S.
            steps = int(1e-6 * timeout_us / TIMEOUT_UNIT_S) + 1
            written = ctypes.string_at(write, write_size) if write_size else b""
            result, data = self.transfer(address, written, read_size, steps * TIMEOUT_UNIT_S)
            if read_size:
                ctypes.memmove(read, data, read_size)
            if result not in (_OK, _NACK_ADDRESS, _NACK_DATA):
                self.recover_bus()
            super().run(self._latency_s)
        except BaseException as error:  # an exception cannot pass through the C code: `run` raises it
            self._error = error
            return -4
        return result

    def run(self, seconds: float) -> None:
        """Advance boards and hub by at least `seconds` of virtual time: a transfer that has started is completed.

        Raises `LinkError` if the emulation has ended.
        """
        end_s = self.now_s + seconds
        while True:
            due_s = self._run_hub()
            now_s = self.now_s
            if now_s >= end_s - 0.5 / PS_PER_S:  # half a picosecond, the resolution of the clock, against rounding
                return
            if due_s > now_s:
                super().run(max(min(due_s, end_s) - now_s, MIN_STEP_S))

    def _run_hub(self) -> float:
        """Execute one pass of the hub's main loop with its transfer.

        Returns the virtual time at which the next pass is due, seconds; infinity for a hub without power. Raises the
        exception of a failed transfer.
        """
        if not self._is_powered:
            return float("inf")
        if self.now_s < self._stalled_until_s:
            return self._stalled_until_s
        due_us = self._hub_library.linux_hub_pass(self._hub)
        self._hub_library.linux_hub_execute(self._hub)
        if self._error is not None:
            error, self._error = self._error, None
            raise error
        return float(due_us) * _PS_PER_US / PS_PER_S

    def send(self, data: bytes) -> int:
        """Send bytes from the host to the hub; return the number of accepted bytes.

        Without power of the hub, all bytes are accepted and lost.
        """
        return int(self._hub_library.linux_hub_send(self._hub, data, len(data))) if self._is_powered else len(data)

    def receive(self) -> bytes:
        """Return the bytes of the hub that have arrived at the host, at most 64 KiB."""
        if self.now_s < self._muted_until_s:
            return b""
        size = self._hub_library.linux_hub_receive(self._hub, self._hub_buffer, RECEIVE_SIZE)
        return ctypes.string_at(self._hub_buffer, size)

    @property
    def has_flow_control(self) -> bool:
        """True: the hub takes bytes only as fast as it processes them."""
        return True

    def inject(self, name: str, address: int = 0, value: float = 0.0, second: float = 0.0) -> None:
        """Inject a fault as in `VirtualWorld`; faults of hub and host act on the hub that this process executes.

        Raises `FaultError` for a fault of the UART.
        """
        if name.startswith(_UART_FAULTS):
            raise FaultError("virtual rig", f"fault '{name}' needs a UART, which a skin without a hub does not have")
        if name == "hub_unplug":
            self._is_powered = False
        elif name == "hub_plug" and not self._is_powered:
            self._is_powered = True
            self._hub_library.linux_hub_restart(self._hub, ResetCause.POWER_ON)
        elif name == "hub_restart":
            self._hub_library.linux_hub_restart(self._hub, ResetCause.BROWN_OUT)
        elif name == "hub_stall":
            self._stalled_until_s = self.now_s + 1e-3 * value
        elif name == "mute_host":
            self._muted_until_s = float("inf") if value else 0.0
        elif name != "hub_plug":
            super().inject(name, address, value, second)

    def close(self) -> None:
        """Release hub and world; a second call has no effect."""
        hub, self._hub = getattr(self, "_hub", None), None
        if hub is not None:
            self._hub_library.linux_hub_free(hub)
        super().close()
