"""What hub and boards have counted, as diagnostics."""

from __future__ import annotations

from typing import Any

from taxel.hand import Hand
from taxel.ros.tree import header
from taxel.stream import HubClient

OK, WARN, STALE = 0, 1, 3


def _status(level: int, name: str, message: str, hardware: str, values: dict[str, int]) -> dict[str, Any]:
    pairs = [{"key": key, "value": str(value)} for key, value in values.items()]
    return {"level": level, "name": name, "message": message, "hardware_id": hardware, "values": pairs}


def diagnostics(hand: Hand, hub: HubClient, time_ns: int) -> dict[str, Any]:
    """A diagnostic_msgs/DiagnosticArray: the stream's losses, and one status for each board."""
    losses, stream = hub.stream.losses, hub.stream
    lost = losses.lost_on_wire
    values = {
        "frames_received": losses.received,
        "frames_lost_on_wire": lost,
        "hub_restarts": losses.restarts,
        "bytes_received": stream.bytes_received,
        "bytes_discarded": stream.bytes_discarded,
    }
    counters = ("frames_dropped", "cycle_time_us", "bus_recoveries")
    values |= {f"hub_{name}": int(hub.status[name]) for name in counters} if hub.status else {}
    text = f"{lost} frames lost on the wire" if lost else "no frame lost on the wire"
    statuses = [_status(WARN if lost else OK, "taxel: hub", text, stream.link.name, values)]
    boards = losses.boards
    for board in hand.boards:
        place = f"0x{board.address:02X}"
        count = boards.get(board.address)
        if count is None:
            statuses.append(_status(STALE, f"taxel: {board.name}", "has sent nothing", place, {}))
            continue
        bad = count.missing + count.damaged
        text = f"{count.missing} frames missing, {count.damaged} damaged" if bad else "complete"
        values = {"received": count.received, "missing": count.missing, "damaged": count.damaged}
        told = hub.board_status.get(board.address, {})
        values |= {name: int(told[name]) for name in ("nacks", "timeouts", "crc_errors", "retries") if name in told}
        statuses.append(_status(WARN if bad else OK, f"taxel: {board.name}", text, place, values))
    return {"header": header(time_ns, ""), "status": statuses}
