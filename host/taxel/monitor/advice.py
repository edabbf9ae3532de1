"""What the person before the screen should do, in one line: the gravest thing first."""

from taxel.monitor.reading import SkinReading
from taxel.skin import Skin

WAIT_S = 1.5
"""So long after the beginning nobody worries that nothing has come."""

LAG_BYTES = 1 << 18
"""More than this waiting: the reader does not keep up (about two seconds of the default hand)."""

NAMED = 3
"""Boards that a line names."""


def advice_of(reading: SkinReading, skin: Skin) -> str | None:
    """What a reading of `skin` asks for; None if all is well."""
    name, is_recorded = skin.link.name, skin.link.is_recorded
    if reading.is_ended:
        return f"{name} has ended" if reading.frames else f"{name} has ended without a frame: is it a stream of a hub?"
    if not reading.frames:
        return _nothing(reading, skin) if reading.watched_s > WAIT_S and not is_recorded else None
    if not reading.boards_streaming and not is_recorded:
        silent_s = min(board.silent_s for board in reading.boards if board.silent_s is not None)
        return f"no frames for {silent_s:.0f} s: look at the hub's power and its cable to this computer"
    missing = [board.board for board in reading.boards if not board.is_well]
    if missing and reading.watched_s > WAIT_S:
        named = ", ".join(f"{board.name} (0x{board.address:02X})" for board in missing[:NAMED])
        more = f" and {len(missing) - NAMED} more" if len(missing) > NAMED else ""
        return f"no frames of {named}{more}: look at power and cable"
    if reading.bytes_waiting > LAG_BYTES and skin.link.is_real_time:
        return f"{reading.bytes_waiting} bytes wait: this computer is too slow, or busy; ask for fewer scans (--rate)"
    if not reading.is_measuring:
        return f"taking the baseline, {100 * reading.baseline:.0f} %: do not touch the skin"
    if reading.disturbed:
        return f"{reading.disturbed} taxels were touched while the baseline was taken: let go, take it again"
    if reading.suspect:
        return f"{reading.suspect} taxels rest above their baseline: let go of the skin, take the baseline again"
    return None


def _nothing(reading: SkinReading, skin: Skin) -> str:
    if skin.hub.boards:
        found = len(skin.hub.boards)
        return f"the hub knows {found} boards, but no frame comes: is another program reading {skin.link.name}?"
    return (
        f"the hub answers, but none of the {len(reading.boards)} boards does: look at their power and their I2C "
        "cables; 'taxel scan' says what is on the bus"
    )
