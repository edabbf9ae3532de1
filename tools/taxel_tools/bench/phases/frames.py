"""How many frames come, how many are missing, and what the bus counted."""

from __future__ import annotations

from taxel_tools.bench.analysis.fault import BOARD, Fault
from taxel_tools.bench.station import Station
from taxel_tools.testing.engine import PhaseLog
from taxel_tools.testing.options import Options
from taxel_tools.wires import HubWire


class Frames:
    """Frame rate, scan time, clock, and errors for each thousand reads."""

    name = "frames"
    title = "Frame rate and bus"
    automatic = True
    limit_names = frozenset({"rate", "rate_of_scans", "scan_time", "missed_scans", "clock", "bus_errors", "saturated"})

    def unmet(self, context: Station) -> str:
        """Nothing is needed."""
        return ""

    def check_options(self, options: Options) -> None:
        """`seconds`: how long frames are counted."""
        self._seconds(options)

    def _seconds(self, options: Options) -> float:
        return options.take_number("seconds", 2.0, 0.2, 3600.0)

    def run(self, context: Station, options: Options, log: PhaseLog) -> None:
        """Measure."""
        seconds = self._seconds(options)
        options.done()
        before, (errors_before, reads_before) = context.status(), context.readout.bus_errors()
        capture = context.frames_for(seconds, log)
        after, (errors_after, reads_after) = context.status(), context.readout.bus_errors()

        def counted(name: str, bits: int = 16) -> int:
            return int((after[name] - before[name]) % 2**bits)

        scan_s = after["scan_time_us"] * 1e-6
        log.measure("rate", capture.rate_hz, "Hz")
        log.measure("scan_time", scan_s * 1e3, "ms")
        log.measure("rate_of_scans", capture.rate_hz * scan_s, "of the scans")
        log.measure("missed_scans", capture.missed, "scans")
        if not isinstance(context.wire, HubWire) and capture.seconds:  # through a hub, times are corrected already
            elapsed = float(capture.board_time_s[-1] - capture.board_time_s[0])
            log.measure("clock", (elapsed / capture.seconds - 1.0) * 1e6, "ppm")
        reads = max(reads_after - reads_before, 1)
        wrong = counted("bus_errors") + counted("rejected_writes") + errors_after - errors_before
        log.measure("bus_errors", 1e3 * wrong / reads, "a thousand reads")
        log.measure("saturated", counted("saturated_conversions"), "conversions")
        log.note(f"{counted('scans', 32)} scans, {reads} reads in {capture.seconds:.1f} s")
        limit = log.limit("bus_errors")
        if limit is not None and not limit.holds(1e3 * wrong / reads):
            text = f"{1e3 * wrong / reads:.1f} of 1000 reads went wrong, {limit} is allowed: look at plug and pull-ups"
            context.evidence.board.append(Fault("bus errors", BOARD, text, limit.severity(1e3 * wrong / reads)))
