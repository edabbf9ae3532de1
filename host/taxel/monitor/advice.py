"""Advice to the user in one line, for the most serious problem of a reading."""

from taxel.hand.branches import find_silent_branches, format_silent_boards
from taxel.monitor.reading import SkinReading
from taxel.skin import Skin

GRACE_S = 1.5
"""Time after the start during which missing frames cause no advice, seconds. Boards need about 1 s to start."""

HUB_SILENT_S = 2.5
"""Time without a message after which the hub is treated as silent, seconds: longer than two intervals of its status
messages."""

LAG_BYTES = 1 << 18
"""Number of unprocessed bytes above which the advice reports that this computer is too slow: about two seconds of data
of the default hand."""


def make_advice(reading: SkinReading, skin: Skin) -> str | None:
    """Return one line of advice to the user if a reading shows a problem of the skin, such as no frames; else None."""
    name, is_recorded = skin.link.name, skin.link.is_recorded
    if reading.is_ended:
        return f"{name} has ended" if reading.frames else f"{name} has ended without a frame: is it a stream of a hub?"
    reconnection = skin.reconnection
    if reconnection is not None and not reconnection.is_open:
        return f"{name}: {reconnection.problem}; the monitor continues when the port is back"
    if not reading.frames:
        return _advise_without_frames(reading, skin) if reading.watched_s > GRACE_S and not is_recorded else None
    if not reading.boards_streaming and not is_recorded:
        if is_hub_alive(skin) and skin.hand.branches:
            return _advise_on_silent_boards(reading, skin)
        silent_s = min(board.silent_s for board in reading.boards if board.silent_s is not None)
        return f"no frames for {silent_s:.0f} s: check the hub's power and its cable to this computer"
    if reading.watched_s > GRACE_S and any(not board.is_streaming for board in reading.boards):
        return _advise_on_silent_boards(reading, skin)
    if reading.bytes_waiting > LAG_BYTES and skin.link.is_real_time:
        remedy = "this computer is too slow or busy; reduce the scan rate (--rate-hz)"
        return f"{reading.bytes_waiting} bytes wait: {remedy}"
    if not reading.is_measuring:
        return f"baseline {100 * reading.baseline_progress:.0f} % complete: do not touch the skin"
    if reading.disturbed:
        return f"{reading.disturbed} taxels were touched during the baseline: release the skin and repeat the baseline"
    if reading.suspect:
        return f"{reading.suspect} taxels are above their baseline: release the skin and repeat the baseline"
    return None


def _advise_on_silent_boards(reading: SkinReading, skin: Skin) -> str:
    """Return the advice for boards from which no frames arrive: faulty branches, then single boards."""
    silent = {board.board.address for board in reading.boards if not board.is_streaming}
    last_s = {board.board.address: -board.silent_s for board in reading.boards if board.silent_s is not None}
    return format_silent_boards(skin.hand, find_silent_branches(skin.hand, silent, last_s))


def is_hub_alive(skin: Skin) -> bool:
    """Whether the hub has sent a message within the last `HUB_SILENT_S` seconds."""
    return skin.hub.seconds_since_message < HUB_SILENT_S


def _advise_without_frames(reading: SkinReading, skin: Skin) -> str:
    """Return the advice for a hub that responds to the handshake but from which no taxel frame arrives."""
    if skin.hub.boards:
        count = len(skin.hub.boards)
        return f"the hub reports {count} boards, but no frame arrives: does another program read {skin.link.name}?"
    return (
        f"the hub responds, but none of the {len(reading.boards)} boards does: check their power and their I2C "
        "cables; 'taxel scan' lists the boards on the bus"
    )
