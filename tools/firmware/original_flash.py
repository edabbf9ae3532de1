"""Program an original board through its original bootloader, over an I2C adapter.

    python tools/firmware/original_flash.py /dev/i2c-1 --address 0x1A              # only report part and rows
    python tools/firmware/original_flash.py /dev/i2c-1 --address 0x1A FILE.cyacd   # write

Start the command, then switch the board on: its bootloader listens for 0.5 s. FILE is a .cyacd of `original_image.py`,
or of the original project. docs/migrate-original-boards.md describes the procedure. Not verified on hardware.
"""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from taxel.errors import TaxelError
from taxel_tools.files.cyacd import read_cyacd_rows
from taxel_tools.open_wire import open_wire
from taxel_tools.original_bootloader import WAIT_S, OriginalInfo, start_original_session, update_original
from taxel_tools.scheduler import run
from taxel_tools.session import BootSession


def format_info(info: OriginalInfo) -> str:
    """Return one line with the part and the rows that the bootloader reports."""
    application = "an application" if info.has_application else "no application"
    return (
        f"silicon id {info.silicon_id:08X}, revision {info.revision}, bootloader {info.version.hex('.')}, "
        f"rows {info.first_row} to {info.last_row}, {application}"
    )


def show_progress(done: int, total: int) -> None:
    """Print the number of written rows at each tenth row and at the end."""
    if done % 10 == 0 or done == total:
        print(f"{done} of {total} rows", flush=True)


def main(arguments: Sequence[str] | None = None) -> int:
    """Report the part of an original board, or write a file to it.

    After a one-line error message the exit status is 1.
    """
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("wire", help="I2C adapter, such as /dev/i2c-1")
    parser.add_argument("file", type=Path, nargs="?", help=".cyacd to write")
    parser.add_argument("--address", type=lambda text: int(text, 0), required=True, help="of the bootloader")
    parser.add_argument("--wait", type=float, default=WAIT_S, metavar="S", help="time to wait for the board, s")
    options = parser.parse_intermixed_args(arguments)  # the file may follow --address
    try:
        content = None if options.file is None else read_cyacd_rows(options.file.read_text(), options.file.name)
        with open_wire(options.wire) as wire:
            if content is None:
                session = BootSession(options.address, wire.now_s)
                print(format_info(run(wire, start_original_session(session, options.wait))))
                return 0
            info = run(
                wire, update_original(options.address, wire.now_s, *content, wait_s=options.wait, report=show_progress)
            )
            print(f"written: {format_info(info)}")
    except (TaxelError, OSError, UnicodeDecodeError) as error:
        print(f"original_flash: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
