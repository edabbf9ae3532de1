"""Packets of the bootloader: build, parse, checksums, and the search for unique ids.

`firmware/bootloader/SPEC.md` explains every byte.
"""

from collections.abc import Callable

from taxel_protocol.bootloader import (
    BOOT_PACKET_END,
    BOOT_PACKET_MAX,
    BOOT_PACKET_OVERHEAD,
    BOOT_PACKET_START,
    BootChecksum,
    SearchReply,
)
from taxel_protocol.layout import unpack


def compute_checksum(kind: BootChecksum, data: bytes) -> int:
    """Compute the checksum of a bootloader packet from its start byte to its last data byte.

    SUM: two's complement of the 16-bit sum. CRC: CRC-16/X-25 (polynomial 0x1021 reflected), its two bytes swapped.
    """
    if kind == BootChecksum.SUM:
        return -sum(data) & 0xFFFF
    crc = 0xFFFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ (0x8408 if crc & 1 else 0)
    crc ^= 0xFFFF
    return (crc & 0xFF) << 8 | crc >> 8


def build_packet(command: int, data: bytes = b"", kind: BootChecksum = BootChecksum.SUM) -> bytes:
    """Build a bootloader packet.

    command: command code, or the status of a response. kind: type of checksum. Raises ValueError if the packet would be
    longer than 64 bytes.
    """
    if len(data) > BOOT_PACKET_MAX - BOOT_PACKET_OVERHEAD:
        raise ValueError(f"a bootloader packet has at most 57 bytes of data, not {len(data)}")
    body = bytes([BOOT_PACKET_START, command]) + len(data).to_bytes(2, "little") + data
    return body + compute_checksum(kind, body).to_bytes(2, "little") + bytes([BOOT_PACKET_END])


def parse_packet(packet: bytes, kind: BootChecksum = BootChecksum.SUM) -> tuple[int, bytes]:
    """Parse a bootloader packet; return (command or status, data).

    Bytes after the packet are ignored, because a read is often too long. Raises ValueError for a packet that is too
    short or whose start byte, end byte, length or checksum is wrong.
    """
    if len(packet) < BOOT_PACKET_OVERHEAD:
        raise ValueError(f"a bootloader packet has at least 7 bytes, not {len(packet)}")
    if packet[0] != BOOT_PACKET_START:
        raise ValueError(f"a bootloader packet begins with 01, not {packet[0]:02X}")
    length = int.from_bytes(packet[2:4], "little")
    if length > len(packet) - BOOT_PACKET_OVERHEAD:
        raise ValueError(f"a bootloader packet of {len(packet)} bytes claims {length} bytes of data")
    if packet[length + 6] != BOOT_PACKET_END:
        raise ValueError(f"a bootloader packet ends with 17, not {packet[length + 6]:02X}")
    stored, expected = (
        int.from_bytes(packet[length + 4 : length + 6], "little"),
        compute_checksum(kind, packet[: length + 4]),
    )
    if stored != expected:
        raise ValueError(f"the checksum of a bootloader packet should be {expected:04X}, not {stored:04X}")
    return packet[1], packet[4 : 4 + length]


def compute_row_sum(row: bytes) -> int:
    """Return the reply to VERIFY_ROW: the two's complement of the sum of the row's bytes, modulo 256."""
    return -sum(row) & 0xFF


def find_unique_ids(send_search: Callable[[int, bytes], bytes | None]) -> list[bytes]:
    """Find the unique ids of all boards that share one I2C address, by a binary search over id prefixes.

    `send_search(bits, prefix)` sends a SEARCH and returns the 16 data bytes of its reply without checking its checksum,
    or None if no board acknowledged the read. All boards whose id begins with the prefix answer at the same time, and
    the bus carries the AND of their answers. At a bit in which two boards differ, both id and complement are therefore
    0: the set of boards is split at the first such bit. n boards take 2 n - 1 searches, and one more search for each
    board, which confirms its complete id. Raises ValueError if a reply is inconsistent.
    """
    unique_ids: list[bytes] = []
    open_prefixes = [(0, bytes(8))]
    while open_prefixes:
        bits, prefix = open_prefixes.pop()
        reply = send_search(bits, prefix)
        if reply is None:
            continue
        fields, _ = unpack(SearchReply, reply)
        ones, zeros = (int.from_bytes(fields[name], "big") for name in ("unique_id", "complement"))
        if ones & zeros:
            raise ValueError(f"the reply to a search sets the same bit in id and complement: {reply.hex()}")
        differing = ~(ones | zeros) & (2**64 - 1)  # bits that are 0 in id and complement
        if not differing:
            if bits < 64:
                open_prefixes.append((64, fields["unique_id"]))
                continue
            unique_ids.append(prefix)
            continue
        split = 64 - differing.bit_length()
        if split < bits:
            raise ValueError(
                f"boards differ in bit {split} although they agree in the first {bits} bits: {reply.hex()}"
            )
        # Continue with both values of bit `split`, after the bits in which all boards of this set agree.
        common = ones & ~(2 ** (64 - split) - 1)
        open_prefixes += [(split + 1, (common | half).to_bytes(8, "big")) for half in (1 << (63 - split), 0)]
    return unique_ids
