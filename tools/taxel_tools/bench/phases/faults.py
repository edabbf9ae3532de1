"""What is wrong with the board, in one list."""

from __future__ import annotations

from taxel_tools.bench.analysis.conclusion import conclude
from taxel_tools.bench.station import Station
from taxel_tools.testing.engine import PhaseLog
from taxel_tools.testing.options import Options


class Faults:
    """Merges what the other phases have seen, so that a fault is named once."""

    name = "faults"
    title = "Named faults"
    automatic = True
    limit_names = frozenset[str]()

    def unmet(self, context: Station) -> str:
        """Something must have been measured, or a test of nothing would pass."""
        return "" if context.was_measured else "no other phase has run"

    def check_options(self, options: Options) -> None:
        """None."""

    def run(self, context: Station, options: Options, log: PhaseLog) -> None:
        """Name them."""
        options.done()
        evidence = context.evidence
        named = conclude(context.kind, evidence.at_rest, evidence.pressed)
        for fault in sorted((*named, *evidence.board), key=lambda one: -one.severity):
            log.finding(fault.name, fault.place, fault.text, fault.severity)
        if evidence.pressed is None:
            log.note("no taxel was pressed: dead taxels, low gain and exchanged lines of one length cannot be seen")
