"""Who the board says it is, and whether that is a board of this hand."""

from __future__ import annotations

from enum import IntEnum

import numpy as np

from taxel.hand import Hand
from taxel_protocol.names import BoardErrorFlag, ResetCause
from taxel_tools.application import firmware_version
from taxel_tools.bench.analysis.fault import BOARD, Fault
from taxel_tools.bench.station import Station
from taxel_tools.firmware_update import format_version
from taxel_tools.testing.engine import PhaseLog
from taxel_tools.testing.options import Options


class Identify:
    """Identity and status registers against the hand description and the plan."""

    name = "identify"
    title = "Identity"
    automatic = True
    limit_names = frozenset({"error_flags"})

    def unmet(self, context: Station) -> str:
        """Nothing is needed."""
        return ""

    def check_options(self, options: Options) -> None:
        """`firmware`: the version that must run, such as "0.1.0"; empty: any."""
        options.take_text("firmware", "")

    def run(self, context: Station, options: Options, log: PhaseLog) -> None:
        """Read, compare."""
        wanted = options.take_text("firmware", "")
        options.done()
        station, identity = context, context.identity
        status = station.status()
        version = format_version(firmware_version(identity))
        log.measure("kind", station.kind.name, "")
        log.measure("taxels", station.kind.taxel_count, "")
        log.measure("firmware", version, "")
        log.measure("unique_id", identity["unique_id"].hex(), "")
        log.measure("error_flags", float(status["error_flags"]), "")
        flags = [flag.name.lower().replace("_", " ") for flag in BoardErrorFlag if status["error_flags"] & flag]
        log.note(f"last start: {_words(ResetCause, status['reset_cause'])}")
        found = station.evidence.board
        if flags:
            found.append(
                Fault("board error", BOARD, f"it reports: {', '.join(flags)}; restart it and test again", float("inf"))
            )
        if identity["address"] != station.address:
            text = f"says that its address is 0x{identity['address']:02X}: provision it"
            found.append(Fault("wrong address", BOARD, text, float("inf")))
        if wanted and version != wanted:
            text = f"runs {version}, the plan asks for {wanted}: flash it"
            found.append(Fault("wrong firmware", BOARD, text, float("inf")))
        if station.hand is not None:
            self._compare(station, station.hand, log)

    def _compare(self, station: Station, hand: Hand, log: PhaseLog) -> None:
        kind = station.kind
        known = {board.kind.code: board.kind for board in hand.boards}.get(kind.code)
        if known is None:
            log.note(f"hand '{hand.name}' has no kind {kind.code}: compared with nothing")
        elif not np.array_equal(known.crossings, kind.crossings):
            text = f"its crossing map is not that of '{known.name}' in hand '{hand.name}': flash the right firmware"
            station.evidence.board.append(Fault("wrong crossing map", BOARD, text, float("inf")))
        for board in hand.boards:
            if board.address == station.address and board.kind.code != kind.code:
                log.note(f"in hand '{hand.name}' the board of this address is of kind '{board.kind.name}'")


def _words(names: type[IntEnum], value: int) -> str:
    """A code in words; the bare number if it is none of ours."""
    return names(value).name.lower().replace("_", " ") if value in set(names) else str(value)
