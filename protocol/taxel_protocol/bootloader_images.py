"""Images with their headers, and the flash rows of metadata and configuration records.

`firmware/bootloader/SPEC.md` explains every byte.
"""

from taxel_protocol.bootloader import BOOT_IMAGE_MAGIC, BOOT_VERSION, LAYOUTS, BootDevice, ImageHeader
from taxel_protocol.framing import crc32
from taxel_protocol.layout import pack


def build_image(device: BootDevice, slot: int, kind: int, version: tuple[int, int, int], content: bytes) -> bytes:
    """Build a firmware image with its header for a slot of a board or hub.

    content: program that begins with the vector table; padded with zeros to a multiple of 4 bytes. kind: type of the
    image. Raises ValueError if the device has no such slot or the image does not fit the slot.
    """
    layout = LAYOUTS[device]
    if slot >= len(layout.first_rows):
        letters = " and ".join("AB"[: len(layout.first_rows)])
        raise ValueError(f"a device {device.name.lower()} has slots {letters}, not slot {slot}")
    header_size = 32
    padded = content + bytes(-len(content) % 4)
    if len(padded) < 8 or header_size + len(padded) > layout.slot_size:
        raise ValueError(f"an image for this slot has 40 to {layout.slot_size} bytes, not {header_size + len(padded)}")
    values = {
        "magic": BOOT_IMAGE_MAGIC,
        "header_version": BOOT_VERSION,
        "device": device,
        "kind": kind,
        "slot": slot,
        "version_major": version[0],
        "version_minor": version[1],
        "version_patch": version[2],
        "reserved_a": 0,
        "length": header_size + len(padded),
        "vectors": layout.slot_address(slot) + header_size,
        "reserved_b": bytes(8),
        "crc32": 0,
    }
    front = pack(ImageHeader, values)[:28]  # the header without its last field, the CRC over header and program
    return front + crc32(front + padded).to_bytes(4, "little") + padded


def build_record(magic: int, sequence: int, content: bytes) -> bytes:
    """Build the 128 bytes of flash that store a record of the bootloader.

    magic: identifies the type of record. sequence: one more than that of the previous record, so that the newest of
    several valid records can be found. Raises ValueError for more than 112 bytes of content.
    """
    if len(content) > 112:
        raise ValueError(f"a record has at most 112 bytes of content, not {len(content)}")
    front = magic.to_bytes(4, "little") + sequence.to_bytes(4, "little") + content + bytes(112 - len(content))
    row = front + crc32(front).to_bytes(4, "little")
    # The last word is 1 if all words before it add up to 0: the flash does not reliably store a row with the sum 0.
    words = sum(int.from_bytes(row[i : i + 4], "little") for i in range(0, 124, 4))
    return row + int(words % 2**32 == 0).to_bytes(4, "little")
