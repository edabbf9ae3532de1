"""Write firmware/generated/taxel_original.h, the constants and board tables of the original hub's messages.

python tools/codegen/original_header.py            write it
python tools/codegen/original_header.py --check    exit status 1 if the file on disk is stale
"""

import sys
from pathlib import Path

from generated_files import write_or_check

from taxel_protocol import original
from taxel_protocol.original import FORMATS, OriginalFormat

HEADER = Path(__file__).resolve().parents[2] / "firmware" / "generated" / "taxel_original.h"

CONSTANTS = (
    *("START", "END", "HEADER_SIZE", "TIMESTAMP_SIZE", "ADDRESSES", "ACCELERATIONS", "RECORD_SIZE", "RECORD_ADDRESS"),
    *("REFERENCE_TIMES", "TIME_STEP_MAX_MS"),
)
"""Names of `taxel_protocol.original` that the header contains."""


def format_boards(known: OriginalFormat) -> list[str]:
    """Return the lines of the macro that lists a format's boards, one X(address, taxels, accelerations) for each."""
    lines = [f"#define TAXEL_{_get_macro_name(known)}_BOARDS(X) \\"]
    for address, taxels in sorted(known.taxels.items()):
        accelerations = original.ACCELERATIONS if address in known.accelerated else 0
        lines.append(f"    X(0x{address:02X}, {taxels}, {accelerations}) \\")
    return [*lines[:-1], lines[-1].removesuffix(" \\"), ""]


def _get_macro_name(known: OriginalFormat) -> str:
    """Return the prefix of a format's macros: `ORIGINAL` for the format `original`, `ORIGINAL_NAME` for any other."""
    name = known.name.removeprefix("original").strip("_").upper()
    return f"ORIGINAL_{name}" if name else "ORIGINAL"


def format_text() -> str:
    """Return the whole text of the header file."""
    lines = [
        "/* Generated from taxel_protocol by tools/codegen/original_header.py (make generate). Do not edit. */",
        "#ifndef TAXEL_ORIGINAL_H",
        "#define TAXEL_ORIGINAL_H",
        "",
    ]
    for name in CONSTANTS:
        value = getattr(original, name)
        lines.append(f"#define TAXEL_ORIGINAL_{name} " + (f"0x{value:02X}u" if value < 16 else f"{value}u"))
    lines.append("")
    for known in FORMATS.values():
        lines += format_boards(known)
    lines.append("/* Formats: X(name, macro of its boards, has_timestamp, is_big_endian, record_size). */")
    lines.append("#define TAXEL_ORIGINAL_FORMATS(X) \\")
    for known in FORMATS.values():
        numbers = f"{int(known.has_timestamp)}, {int(known.is_big_endian)}, {known.record_size}"
        lines.append(f"    X({known.name}, TAXEL_{_get_macro_name(known)}_BOARDS, {numbers}) \\")
    lines[-1] = lines[-1].removesuffix(" \\")
    return "\n".join([*lines, "", "#endif", ""])


def main() -> int:
    """Write the header, or with --check compare it with the file on disk; the exit status is 1 if that one is stale."""
    return write_or_check({HEADER: format_text()})


if __name__ == "__main__":
    sys.exit(main())
