"""Phase `identify`: identity of the board, compared with the hand description and the plan."""

from enum import IntEnum

import numpy as np

from taxel.hand import Hand
from taxel_protocol.names import BoardErrorFlag, ResetCause
from taxel_tools.application import get_firmware_version
from taxel_tools.bench.analysis.fault import BOARD, Fault
from taxel_tools.bench.board_under_test import BoardUnderTest
from taxel_tools.firmware_update import format_version
from taxel_tools.testing.engine import PhaseLog
from taxel_tools.testing.options import Options


class Identify:
    """Phase that compares the identity and status registers with the hand description and the plan."""

    name = "identify"
    title = "Identity"
    is_automatic = True
    limit_names = frozenset({"error_flags"})

    def find_unmet_requirement(self, board: BoardUnderTest) -> str:
        """Return "", because the identification phase needs only the board."""
        return ""

    def check_options(self, options: Options) -> None:
        """Check the option of the identification phase, `firmware`.

        It is the required version, such as "0.1.0"; empty for any version.
        """
        options.take_text("firmware", "")

    def run(self, board: BoardUnderTest, options: Options, log: PhaseLog) -> None:
        """Read identity and status of the board, and report deviations from the hand description and the plan."""
        required_version = options.take_text("firmware", "")
        options.refuse_unknown_keys()
        identity, status = board.identity, board.read_status()
        version = format_version(get_firmware_version(identity))
        log.measure("kind", board.kind.name, "")
        log.measure("taxels", board.kind.taxel_count, "")
        log.measure("firmware", version, "")
        log.measure("unique_id", identity["unique_id"].hex(), "")
        log.measure("error_flags", float(status["error_flags"]), "")
        flags = [flag.name.lower().replace("_", " ") for flag in BoardErrorFlag if status["error_flags"] & flag]
        log.add_note(f"last start: {_format_code(ResetCause, status['reset_cause'])}")
        fault = board.read_fault()
        if fault is not None:
            log.add_note(f"last fault: {fault.describe()}")
        faults = board.evidence.board
        if flags:
            text = f"reported error flags: {', '.join(flags)}; restart the board and repeat the test"
            faults.append(Fault("board error", BOARD, text, float("inf")))
        if identity["address"] != board.address:
            text = f"the identity contains the address 0x{identity['address']:02X}; use taxel provision"
            faults.append(Fault("wrong address", BOARD, text, float("inf")))
        if required_version and version != required_version:
            text = f"firmware {version}, the plan requires {required_version}; use taxel flash"
            faults.append(Fault("wrong firmware", BOARD, text, float("inf")))
        if board.hand is not None:
            self._compare_with_hand(board, board.hand, log)

    def _compare_with_hand(self, board: BoardUnderTest, hand: Hand, log: PhaseLog) -> None:
        """Compare kind and crossing map of the board with the hand description.

        Adds a fault for a deviating crossing map, and a note for an unknown kind or a kind that is planned at another
        address.
        """
        kind = board.kind
        hand_kind = {hand_board.kind.code: hand_board.kind for hand_board in hand.boards}.get(kind.code)
        if hand_kind is None:
            log.add_note(f"hand '{hand.name}' has no kind {kind.code}; the board was not compared with it")
        elif not np.array_equal(hand_kind.crossings, kind.crossings):
            text = f"the crossing map differs from '{hand_kind.name}' in hand '{hand.name}'; write the right firmware"
            board.evidence.board.append(Fault("wrong crossing map", BOARD, text, float("inf")))
        for hand_board in hand.boards:
            if hand_board.address == board.address and hand_board.kind.code != kind.code:
                log.add_note(f"in hand '{hand.name}' the board at this address is of kind '{hand_board.kind.name}'")


def _format_code(names: type[IntEnum], value: int) -> str:
    """Return the name of a numeric code in a register in lower case; the number if the code is unknown."""
    return names(value).name.lower().replace("_", " ") if value in set(names) else str(value)
