"""Loss counters of the hub and the boards as a ROS diagnostics message."""

from collections.abc import Mapping
from typing import Any

from taxel.hand import Hand
from taxel.hand.branches import find_silent_branches
from taxel.ros.tf_tree import make_header
from taxel.stream import HubClient
from taxel_protocol import BoardState

OK, WARN, ERROR, STALE = 0, 1, 2, 3  # constants of diagnostic_msgs/DiagnosticStatus

_HUB_COUNTERS = ("frames_dropped", "cycle_time_us", "bus_recoveries")
_BOARD_COUNTERS = ("nacks", "timeouts", "crc_errors", "retries")


def make_diagnostics_message(hand: Hand, hub: HubClient, time_ns: int) -> dict[str, Any]:
    """Make a diagnostic_msgs/DiagnosticArray message with one status for the hub, each board and each branch.

    time_ns: Unix time of the message, nanoseconds. Branches are omitted before the hub has reported its own status.
    """
    statuses = [_make_hub_status(hub)]
    statuses += [_make_board_status(hub, board.address, board.name) for board in hand.boards]
    statuses += _make_branch_statuses(hand, hub)
    return {"header": make_header(time_ns, ""), "status": statuses}


def _make_hub_status(hub: HubClient) -> dict[str, Any]:
    """Make the DiagnosticStatus of the hub: frames and bytes received and lost, and the hub's own counters."""
    losses, stream = hub.stream.losses, hub.stream
    lost = losses.lost_on_wire
    values = {
        "frames_received": losses.frames_received,
        "frames_lost_on_wire": lost,
        "frames_unknown": losses.unknown_frames,
        "hub_restarts": losses.restarts,
        "bytes_received": stream.bytes_received,
        "bytes_discarded": stream.bytes_discarded,
    }
    values |= {f"hub_{name}": int(hub.status[name]) for name in _HUB_COUNTERS} if hub.status else {}
    text = f"{lost} frames lost on the wire" if lost else "no frame lost on the wire"
    return make_status(WARN if lost else OK, "taxel: hub", text, stream.link.name, values)


def _make_board_status(hub: HubClient, address: int, name: str) -> dict[str, Any]:
    """Make the DiagnosticStatus of one board: frames received, missing and damaged, and the hub's counters of it.

    The level is STALE if no frame of the board has arrived, WARN if frames are missing or damaged.
    """
    title, hardware_id = f"taxel: {name}", f"0x{address:02X}"
    count = hub.stream.losses.boards.get(address)
    if count is None:
        return make_status(STALE, title, "has sent nothing", hardware_id, {})
    faulty = count.missing + count.damaged
    text = f"{count.missing} frames missing, {count.damaged} damaged" if faulty else "complete"
    values = {"received": count.received, "missing": count.missing, "damaged": count.damaged}
    reported = hub.board_status.get(address, {})
    values |= {counter: int(reported[counter]) for counter in _BOARD_COUNTERS if counter in reported}
    return make_status(WARN if faulty else OK, title, text, hardware_id, values)


def _make_branch_statuses(hand: Hand, hub: HubClient) -> list[dict[str, Any]]:
    """Make the DiagnosticStatus of each branch of the wiring: an error if no board of the branch responds to the hub.

    The states are those of the latest BOARD_STATUS messages; a board without such a message is treated as absent.
    Returns an empty list before the hub has reported its own status.
    """
    if not hub.status:
        return []
    states = {address: fields["state"] for address, fields in hub.board_status.items()}
    silent = [board.address for board in hand.boards if states.get(board.address) in (None, BoardState.ABSENT)]
    faulty = find_silent_branches(hand, silent).branches
    statuses = []
    for name in hand.branches:
        boards = hand.find_branch(name)
        text = "all boards stopped together: check its cable and connectors" if name in faulty else "responds"
        values = {"boards": len(boards), "silent": sum(board.address in silent for board in boards)}
        level = ERROR if name in faulty else OK
        statuses.append(make_status(level, f"taxel: branch {name}", text, f"branch {name}", values))
    return statuses


def make_status(level: int, name: str, message: str, hardware_id: str, values: Mapping[str, float]) -> dict[str, Any]:
    """Make a diagnostic_msgs/DiagnosticStatus. level: OK, WARN, ERROR or STALE. values: counters by name."""
    pairs = [{"key": key, "value": str(value)} for key, value in values.items()]
    return {"level": level, "name": name, "message": message, "hardware_id": hardware_id, "values": pairs}
