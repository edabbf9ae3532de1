"""Write the files for a programmer or for the original bootloader from a linked image of the original hardware.

    python tools/firmware/original_image.py --linked ELF --name palm --out DIR [--address 0x15] [--silicon-id ID]

Writes DIR/NAME.hex. `--address` replaces the I2C address of a sensor board; the original boards have no other place for
it. An image that does not begin at row 0 lies behind the original bootloader: its file also contains that bootloader's
metadata in the last row of the flash. With `--silicon-id`, as the bootloader reports it, such an image is also written
as DIR/NAME.cyacd for the manufacturer's tools. The same input gives the same bytes.
"""

import argparse
import sys
from pathlib import Path
from typing import Final, NoReturn

from firmware_elf import LinkedImage, read_linked_image

from taxel.errors import TaxelError
from taxel_protocol.bootloader import BOOT_ROW_SIZE
from taxel_protocol.limits import ADDRESS_MAX, ADDRESS_MIN
from taxel_tools.errors import FirmwareFileError
from taxel_tools.files.intel_hex import write_intel_hex
from taxel_tools.files.original_image import OriginalImage

HEX_END: Final = ":00000001FF\n"
ADDRESS_OFFSET: Final = 1
"""Offset of the address in a configuration record (`taxel_protocol.bootloader.Configuration`)."""


def _fail(path: str, field: str, expected: str, found: str, remedy: str) -> NoReturn:
    """Raise `FirmwareFileError` for a linked image or an option."""
    raise FirmwareFileError(path, field, expected, found, remedy)


def read_original_image(linked: LinkedImage, address: int | None = None) -> OriginalImage:
    """Return the image of an original board or hub from its linked ELF file.

    address: I2C address of the board; None: the address of the pins file. Raises FirmwareFileError.
    """
    for symbol in ("image_first_row", "image_end_row", "standalone_entry"):
        if symbol not in linked.symbols:
            _fail(linked.path, f"symbol {symbol}", "one", "none", "pass the ELF of an image of the original hardware")
    first_row = linked.symbol("image_first_row")
    # the linker's number of rows excludes the row of the metadata
    rows = linked.symbol("image_end_row") + (1 if first_row else 0)
    content = bytearray(linked.content)
    if linked.address != first_row * BOOT_ROW_SIZE:
        _fail(linked.path, "first address", f"0x{first_row * BOOT_ROW_SIZE:X}", f"0x{linked.address:X}", "rebuild it")
    if address is not None:
        if not ADDRESS_MIN <= address <= ADDRESS_MAX:
            expected = f"an I2C address from 0x{ADDRESS_MIN:02X} to 0x{ADDRESS_MAX:02X}"
            _fail(linked.path, "address", expected, f"0x{address:X}", "pass another address")
        if "standalone_configuration" not in linked.symbols:
            _fail(linked.path, "address", "an image of a board", "one of the hub", "the hub has no address")
        content[linked.symbol("standalone_configuration") - linked.address + ADDRESS_OFFSET] = address
    content += bytes(-len(content) % 4)
    return OriginalImage(first_row, rows, bytes(content), linked.symbol("standalone_entry") | 1)


def write_cyacd_rows(image: OriginalImage, silicon_id: int) -> str:
    """Return the text of a .cyacd file with the packet checksum "basic sum", for the manufacturer's tools."""
    lines = [f"{silicon_id:08X}0000"]
    for row, data in image.list_rows():
        body = bytes([0]) + row.to_bytes(2, "big") + len(data).to_bytes(2, "big") + data
        lines.append(":" + (body + bytes([-sum(body) & 0xFF])).hex().upper())
    return "\n".join(lines) + "\n"


def write_files(linked: Path, name: str, out: Path, address: int | None, silicon_id: int | None) -> None:
    """Write NAME.hex, and NAME.cyacd if a silicon id is given, to the folder `out`.

    linked: linked image (ELF). address: I2C address of the board, which is stored in the image; None: the address of
    the pins file. silicon_id: id of the part, in the first line of the .cyacd file. Raises FirmwareFileError, OSError.
    """
    image = read_original_image(read_linked_image(linked), address)
    if silicon_id is not None and not image.first_row:
        remedy = "build with -DTAXEL_ORIGINAL_FIRST_ROW=N (docs/migrate-original-boards.md)"
        _fail(str(linked), "silicon id", "an image behind the original bootloader", "one that begins at row 0", remedy)
    text = write_intel_hex(image.content, image.first_row * BOOT_ROW_SIZE)
    if image.first_row:
        metadata = write_intel_hex(image.metadata_row(), (image.rows - 1) * BOOT_ROW_SIZE)
        text = text.removesuffix(HEX_END) + metadata
    out.mkdir(parents=True, exist_ok=True)
    (out / f"{name}.hex").write_text(text)
    if silicon_id is not None:
        (out / f"{name}.cyacd").write_text(write_cyacd_rows(image, silicon_id))


def main() -> int:
    """Write the files of one device of the original hardware; after a one-line error message the exit status is 1."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--linked", type=Path, required=True)
    parser.add_argument("--name", required=True, help="prefix of the file names")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--address", type=lambda text: int(text, 0), help="I2C address of the board")
    parser.add_argument("--silicon-id", type=lambda text: int(text, 0), help="write a .cyacd for this part")
    options = parser.parse_args()
    try:
        write_files(options.linked, options.name, options.out, options.address, options.silicon_id)
    except (TaxelError, OSError) as error:
        print(f"original_image: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
