"""Settings of the emulated original hub and boards: the world-file line `protocol original ...`."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from taxel.hand.description import Hand
from taxel_protocol.original import READ_SEQUENCE

VARIANTS: Final = ("main", "branch")
MESSAGES: Final = ("timestamp", "no_timestamp", "high_byte_first")
KNOWN_FAULTS: Final = ("truncated_taxel", "wrong_buffer", "receive_buffer", "wait_for_ever", "stale_timestamp")


@dataclass(frozen=True)
class OriginalFirmware:
    """Behaviour of the original hub and boards; firmware/emulator/README.md describes each option.

    The default values are those of the public firmware of the first generation. `variant`: treatment of a board that
    does not answer, one of `VARIANTS`. `message`: message format, one of `MESSAGES`. `delay_ms`: delay after each poll
    cycle. `is_paced`: the UART driver sends at most 8 bytes per 0.5 ms tick. `ring_size`: bytes of the transmit ring
    buffer. `copy_us`: time in which a board copies one count. `known_faults`: names in `KNOWN_FAULTS`, faults of the
    public firmware that are emulated. `skipped_addresses`: boards of the hand that the hub does not poll.
    `accelerated_addresses`: boards that send three more words, accelerations, after the counts.
    """

    variant: str = "main"
    message: str = "timestamp"
    delay_ms: float = 50.0
    is_paced: bool = True
    ring_size: int = 128
    copy_us: float = 1.0
    known_faults: Sequence[str] = ()
    skipped_addresses: Sequence[int] = ()
    accelerated_addresses: Sequence[int] = ()


FIRST_GENERATION: Final = OriginalFirmware()
"""Firmware of the 22 boards of the first generation (224 taxels), as it is public: 8.7 Hz."""

THESIS: Final = OriginalFirmware(delay_ms=0.0, is_paced=False, ring_size=256)
"""Settings with which 15 boards of 905 taxels reach the 5.97 Hz that the UART allows.

The firmware of the thesis's boards is not public. With the settings of the first generation the 15 boards would run at
3.4 Hz. These settings keep its bus clock (100 kbit/s) and baud rate, and omit the delay and the pacing; a ring of 256
bytes lets the hub read the next board while a whole message (at most 250 bytes) waits for the UART. Other settings
reach the same rate, for example a bus at 400 kbit/s. `tools/original/rate.py` measures the share of each cause.
"""


def list_polled_addresses(hand: Hand, skipped_addresses: Sequence[int] = ()) -> list[int]:
    """List the addresses of the polled boards in the read order of the original hub: 0x17 to 0x1D, then 0x08 to 0x16.

    A hand with other addresses is read in the order of its description. Raises ValueError for a skipped address that
    the hand does not have, or if no address is left.
    """
    addresses = [board.address for board in hand.boards]
    unknown = sorted(set(skipped_addresses) - set(addresses))
    if unknown:
        raise ValueError(f"skipped address 0x{unknown[0]:02X}: expected the address of a board of hand {hand.name}")
    polled = [address for address in addresses if address not in skipped_addresses]
    if not polled:
        raise ValueError(f"expected at least one board of hand {hand.name} that is not skipped")
    if set(polled) <= set(READ_SEQUENCE):
        polled.sort(key=READ_SEQUENCE.index)
    return polled


def format_original(hand: Hand, firmware: OriginalFirmware) -> str:
    """Format the world-file line that selects the original hub and boards.

    Raises ValueError as `list_polled_addresses` does.
    """
    polled = list_polled_addresses(hand, firmware.skipped_addresses)
    words = [
        "protocol original",
        f"order={','.join(f'0x{address:02X}' for address in polled)}",
        f"variant={firmware.variant}",
        f"message={firmware.message}",
        f"delay_ms={firmware.delay_ms!r}",
        f"pacing={int(firmware.is_paced)}",
        f"ring={firmware.ring_size}",
        f"copy_us={firmware.copy_us!r}",
    ]
    accelerated = ",".join(f"0x{address:02X}" for address in firmware.accelerated_addresses)
    words += [f"accelerations={accelerated}"] if accelerated else []
    words += [f"faults={','.join(firmware.known_faults)}"] if firmware.known_faults else []
    return " ".join(words)
