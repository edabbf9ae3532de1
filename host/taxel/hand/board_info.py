"""BOARD_INFO fields of a described board, for programs that reply to a host in place of a hub."""

import zlib
from typing import Any

from taxel.hand.boards import Board
from taxel_protocol.frames import BoardInfo
from taxel_protocol.layout import list_fields, pack
from taxel_protocol.limits import REGISTER_MAP_VERSION, SNAPSHOT_OVERHEAD
from taxel_protocol.registers import Identity


def make_board_info(board: Board) -> dict[str, Any]:
    """Make the fields, by name, of the BOARD_INFO frame in which a hub would report this board.

    The identity of the board (kind, address, lines, crossing map) has a valid CRC; all other fields are 0.
    """
    kind = board.kind
    fields: dict[str, Any] = {field.name: field.constant or 0 for field in list_fields(Identity)}
    fields |= {"map_version": REGISTER_MAP_VERSION, "kind": kind.code, "address": board.address, "unique_id": bytes(8)}
    fields |= {"rows": kind.tx_count, "columns": kind.rx_count, "taxel_count": kind.taxel_count}
    fields |= {"snapshot_size": SNAPSHOT_OVERHEAD + 2 * kind.taxel_count, "crossing_map": kind.pack_crossings()}
    # The CRC covers all bytes of the identity before the CRC itself, its last 4 bytes.
    fields["crc32"] = zlib.crc32(pack(Identity, fields)[:-4])
    info: dict[str, Any] = {field.name: 0 for field in list_fields(BoardInfo)}
    return info | {f"identity_{name}": value for name, value in fields.items()}
