"""Write firmware/generated/taxel_bootloader.h and the vectors of its C test from taxel_protocol.bootloader.

python tools/codegen/bootloader_header.py            write them
python tools/codegen/bootloader_header.py --check    exit status 1 if a file on disk is stale
"""

import random
import sys
from pathlib import Path

from c_header import format_enumeration, format_structure
from generated_files import write_or_check

from taxel_protocol import bootloader as boot
from taxel_protocol.bootloader_images import build_image, build_record
from taxel_protocol.bootloader_packets import build_packet
from taxel_protocol.layout import pack

FIRMWARE = Path(__file__).resolve().parents[2] / "firmware"

HEADER = FIRMWARE / "generated" / "taxel_bootloader.h"
VECTORS = FIRMWARE / "tests" / "test_bootloader_vectors.h"
MARK = "Generated from protocol/taxel_protocol/bootloader.py by tools/codegen/bootloader_header.py. Do not edit."
SEED = 20
STRUCTS = {
    "boot_image_header": boot.ImageHeader,
    "boot_record": boot.Record,
    "boot_metadata": boot.Metadata,
    "boot_configuration": boot.Configuration,
    "boot_enter_reply": boot.EnterReply,
    "boot_flash_size_reply": boot.FlashSizeReply,
    "boot_row_address": boot.RowAddress,
    "boot_stock_metadata": boot.StockMetadata,
    "boot_info": boot.Info,
    "boot_search_arguments": boot.SearchArguments,
    "boot_search_reply": boot.SearchReply,
    "boot_write_configuration_arguments": boot.WriteConfigurationArguments,
}
ENUMS = (boot.BootCommand, boot.BootStatus, boot.BootDevice, boot.BootChecksum, boot.BootStay)


PART_CONSTANTS = (
    "BOOT_ROW_COUNT",
    "BOOT_CONFIGURATION_ROW",
    "BOOT_METADATA_ROW",
    "BOOT_SILICON_ID",
    "BOOT_SILICON_ID_16K",
    "BOOT_SILICON_ID_64K",
)
PARTS = {
    "defined TAXEL_BOOT_ONE_SLOT": (boot.BootDevice.BOARD_16K,),
    "defined TAXEL_BOOT_64K": (boot.BootDevice.BOARD_64K, boot.BootDevice.HUB_64K),
    "": (boot.BootDevice.BOARD, boot.BootDevice.HUB),
}
"""Condition of the C preprocessor that selects a part -> devices with this part; "" for the PSoC 4200."""


def _format_number(value: int) -> str:
    """Format a constant for C: large numbers in hexadecimal."""
    return f"{value if value < 2**16 else f'0x{value:08X}'}u"


def _format_part(layouts: list[boot.FlashLayout]) -> list[str]:
    """Format the constants of a part, and the table of the flash layouts of the devices with this part."""
    first = layouts[0]
    slots = len(first.first_rows)
    names = {
        "SLOTS": slots,
        "ROW_COUNT": first.row_count,
        "BOOTLOADER_ROWS": first.bootloader_rows,
        "CONFIGURATION_ROW": first.configuration_row,
        "METADATA_ROW": first.metadata_row,
        "SILICON_ID": first.silicon_id,
    }
    lines = [f"#define TAXEL_BOOT_{name} {_format_number(value)}" for name, value in names.items()]
    rows = [
        f"    X({layout.device.name}, {layout.first_rows[0]}u, {layout.first_rows[-1]}u, {layout.slot_rows}u)"
        for layout in layouts
    ]
    return [*lines, "#define TAXEL_BOOT_LAYOUTS(X) \\", " \\\n".join(rows)]


def format_header() -> str:
    """Format the C header of the bootloader: constants, names, the table of flash layouts, packed structs."""
    lines = [f"/* {MARK} */", "#ifndef TAXEL_BOOT_PROTOCOL_H", "#define TAXEL_BOOT_PROTOCOL_H", ""]
    lines += ['#include "generated/taxel_protocol.h"', ""]
    for name, value in vars(boot).items():
        if name.startswith("BOOT_") and name not in PART_CONSTANTS:
            lines.append(f"#define TAXEL_{name} {_format_number(value)}")
    lines += [
        "",
        "/* Constants of the part. TAXEL_BOOT_ONE_SLOT: a part with 16 KiB of flash, which has slot A only.",
        " * TAXEL_BOOT_64K: a part with 64 KiB of flash.",
        " *",
        " * TAXEL_BOOT_LAYOUTS: X(device, first row of slot A, first row of slot B, rows of a slot) */",
    ]
    for number, (condition, devices) in enumerate(PARTS.items()):
        lines += [f"#{'elif' if number else 'if'} {condition}" if condition else "#else"]
        lines += _format_part([boot.LAYOUTS[device] for device in devices])
    lines += ["#endif", ""]
    for enum in ENUMS:
        lines += format_enumeration(enum)
    for name, definition in STRUCTS.items():
        lines += format_structure(name, definition)
    return "\n".join([*lines, "#endif", ""])


def _format_array(name: str, data: bytes) -> list[str]:
    """Format the lines of C code that define a constant array of bytes, 16 bytes per line."""
    body = [", ".join(f"0x{byte:02X}" for byte in data[i : i + 16]) for i in range(0, len(data), 16)]
    return [f"static const uint8_t {name}[{len(data)}] = {{", *[f"    {line}," for line in body], "};"]


def format_vectors() -> str:
    """Format the test vectors of the bootloader: packets with both checksums, an image, and two flash rows."""
    draw = random.Random(SEED)
    lines = [f"/* {MARK} Seed {SEED}. */", "#ifndef TEST_BOOTLOADER_VECTORS_H", "#define TEST_BOOTLOADER_VECTORS_H", ""]
    lines += ["#include <stdint.h>", ""]
    commands = [(boot.BootCommand.ENTER, b""), (boot.BootCommand.SYNC, b"123456789")]
    commands += [(boot.BootCommand.SEND_DATA, draw.randbytes(size)) for size in (1, 56, 57)]
    for kind in (boot.BootChecksum.SUM, boot.BootChecksum.CRC):
        for i, (command, data) in enumerate(commands):
            lines += _format_array(f"packet_{kind.name.lower()}_{i}", build_packet(command, data, kind))
    lines += _format_array("image_a", build_image(boot.BootDevice.BOARD, 0, 3, (1, 2, 3), draw.randbytes(301)))
    lines += _format_array("image_b", build_image(boot.BootDevice.HUB, 1, 0, (4, 5, 6), draw.randbytes(96)))
    metadata = pack(boot.Metadata, {"confirmed": 1, "pending": 0, "tries": bytes([2, 3])})
    lines += _format_array("metadata_row", build_record(boot.BOOT_METADATA_MAGIC, 7, metadata))
    configuration = pack(
        boot.Configuration,
        {
            "version": boot.BOOT_VERSION,
            "address": 0x23,
            "kind": 3,
            "reserved": 0,
            "serial_number": b"TX-0003".ljust(16, b"\0"),
            "idac_codes": draw.randbytes(16),
        },
    )
    lines += _format_array("configuration", configuration)
    lines += _format_array("configuration_row", build_record(boot.BOOT_CONFIGURATION_MAGIC, 0xFFFFFFFF, configuration))
    return "\n".join([*lines, "", "#endif", ""])


def main() -> int:
    """Write the C header and test vectors of the bootloader, or check that they are up to date."""
    return write_or_check({HEADER: format_header(), VECTORS: format_vectors()})


if __name__ == "__main__":
    sys.exit(main())
