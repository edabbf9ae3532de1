"""Checks of an I2C adapter before a hub runs on it: its functions, and whether a board answers."""

from __future__ import annotations

import errno
import re
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Final

from taxel.link.errors import LinkError
from taxel.link.i2c_port import open_i2c

if TYPE_CHECKING:
    import smbus2

I2C_FUNC_I2C: Final = 0x00000001
"""Bit that is set in the function flags of an adapter that performs plain I2C transfers (linux/i2c.h)."""

DEFAULT_SCL_HZ: Final = 100e3
"""Bus clock of an adapter whose clock is not in the device tree, Hz: the default of most drivers."""

BOARD_TIMEOUT_S: Final = 0.5
"""Longest wait for the first board, seconds. Boards answer within 50 ms of power-up; their bootloader may wait 100 ms
for a host. A longer time delays the error message for a bus without boards."""

_SYSFS: Final = Path("/sys/bus/i2c/devices")
_NACK_ERRNOS: Final = {errno.ENXIO, errno.EREMOTEIO, errno.ENODATA}
_REJECTED_ERRNOS: Final = {errno.EOPNOTSUPP, errno.EINVAL}


def open_adapter(device: str) -> smbus2.SMBus:
    """Open the adapter `/dev/i2c-N`. The caller closes it.

    Raises the errors of `open_i2c`, and `LinkError` for an adapter without plain I2C transfers.
    """
    bus = open_i2c(device)
    if not int(bus.funcs) & I2C_FUNC_I2C:
        bus.close()
        raise LinkError(
            device,
            "the adapter transfers SMBus commands only, but boards need plain I2C transfers (I2C_FUNC_I2C); use "
            "another adapter, such as the I2C pins of a Raspberry Pi or a USB bridge with an I2C driver",
        )
    return bus


def read_scl_hz(device: str) -> float:
    """Return the bus clock of the adapter `/dev/i2c-N` in Hz: the value in the device tree, else `DEFAULT_SCL_HZ`."""
    number = re.search(r"(\d+)$", device)
    path = _SYSFS / f"i2c-{number[1] if number else ''}" / "of_node" / "clock-frequency"
    try:
        value = int.from_bytes(path.read_bytes(), "big")
    except OSError:
        return DEFAULT_SCL_HZ
    return float(value) if value else DEFAULT_SCL_HZ


def check_board_answers(bus: smbus2.SMBus, device: str, addresses: Sequence[int]) -> None:
    """Wait until a board acknowledges one of the I2C addresses.

    device: path of the adapter for error messages. Raises `LinkError` if no board acknowledges within
    `BOARD_TIMEOUT_S`; the message states whether a line of the bus seems to be held low.
    """
    deadline = time.monotonic() + BOARD_TIMEOUT_S
    while True:
        failures = [_probe_address(bus, device, address) for address in addresses]
        if None in failures:
            return
        if time.monotonic() > deadline:
            break
        time.sleep(0.02)
    errors = sorted({failure for failure in failures if failure not in _NACK_ERRNOS and failure is not None})
    if errors:
        name = errno.errorcode.get(errors[0], str(errors[0]))
        raise LinkError(
            device,
            f"no board answers, and transfers fail with '{name}': SDA or SCL is held low or has no pull-up; measure "
            "both lines (3.3 V without traffic), then disconnect boards one at a time",
        )
    searched = "any address" if len(addresses) > 1 else f"0x{addresses[0]:02X}"
    if 1 < len(addresses) < 112:  # 112: number of all permitted addresses
        searched = ", ".join(f"0x{address:02X}" for address in addresses)
    raise LinkError(
        device,
        f"no board answers at {searched}; check power, ground, SDA and SCL of the boards, and compare with "
        f"`i2cdetect -y {device.rpartition('-')[2]}`",
    )


def _probe_address(bus: smbus2.SMBus, device: str, address: int) -> int | None:
    """Send a board's address without data; if the adapter rejects an empty transfer, read one byte of the board.

    Returns None if a board acknowledges, else the error number of the kernel. Raises `LinkError` if the adapter itself
    fails.
    """
    from smbus2 import i2c_msg

    for message in (i2c_msg.write(address, []), i2c_msg.read(address, 1)):
        try:
            bus.i2c_rdwr(message)
        except OSError as error:
            if error.errno in _REJECTED_ERRNOS:
                continue  # some adapters reject a transfer without data
            if error.errno in (errno.ENODEV, errno.ESHUTDOWN):
                raise LinkError(device, f"the adapter is gone ({error.strerror}); check its plug") from None
            return error.errno or errno.EIO
        return None
    return errno.EOPNOTSUPP
