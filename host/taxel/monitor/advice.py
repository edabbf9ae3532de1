"""Advice to the user in one line, for the most serious problem of a reading."""

from taxel.monitor.reading import SkinReading
from taxel.skin import Skin

GRACE_S = 1.5
"""Time after the start in which missing frames give no advice, seconds. Boards need about 1 s to start."""

LAG_BYTES = 1 << 18
"""Number of waiting bytes above which the reader does not keep up: about two seconds of the default hand."""

MAX_NAMED_BOARDS = 3
"""Largest number of boards that one line names."""


def make_advice(reading: SkinReading, skin: Skin) -> str | None:
    """Return one line of advice to the user if a reading shows a problem of the skin, such as no frames; else None."""
    name, is_recorded = skin.link.name, skin.link.is_recorded
    if reading.is_ended:
        return f"{name} has ended" if reading.frames else f"{name} has ended without a frame: is it a stream of a hub?"
    if not reading.frames:
        return _advise_without_frames(reading, skin) if reading.watched_s > GRACE_S and not is_recorded else None
    if not reading.boards_streaming and not is_recorded:
        silent_s = min(board.silent_s for board in reading.boards if board.silent_s is not None)
        return f"no frames for {silent_s:.0f} s: check the hub's power and its cable to this computer"
    missing = [board.board for board in reading.boards if not board.is_streaming]
    if missing and reading.watched_s > GRACE_S:
        names = ", ".join(f"{board.name} (0x{board.address:02X})" for board in missing[:MAX_NAMED_BOARDS])
        more = f" and {len(missing) - MAX_NAMED_BOARDS} more" if len(missing) > MAX_NAMED_BOARDS else ""
        return f"no frames from {names}{more}: check power and cable"
    if reading.bytes_waiting > LAG_BYTES and skin.link.is_real_time:
        remedy = "this computer is too slow or busy; reduce the scan rate (--rate-hz)"
        return f"{reading.bytes_waiting} bytes wait: {remedy}"
    if not reading.is_measuring:
        return f"baseline {100 * reading.baseline:.0f} % complete: do not touch the skin"
    if reading.disturbed:
        return f"{reading.disturbed} taxels were touched during the baseline: release the skin and repeat the baseline"
    if reading.suspect:
        return f"{reading.suspect} taxels are above their baseline: release the skin and repeat the baseline"
    return None


def _advise_without_frames(reading: SkinReading, skin: Skin) -> str:
    """Return the advice for a hub that responds to the handshake while no taxel frame arrives."""
    if skin.hub.boards:
        count = len(skin.hub.boards)
        return f"the hub reports {count} boards, but no frame arrives: does another program read {skin.link.name}?"
    return (
        f"the hub responds, but none of the {len(reading.boards)} boards does: check their power and their I2C "
        "cables; 'taxel scan' lists the boards on the bus"
    )
