"""Phase `frames`: frame rate, missed scans, and counters of the bus."""

from taxel_tools.bench.analysis.fault import BOARD, Fault
from taxel_tools.bench.board_under_test import BoardUnderTest
from taxel_tools.testing.engine import PhaseLog
from taxel_tools.testing.options import Options
from taxel_tools.wires import HubWire


class Frames:
    """Phase that measures frame rate, scan time, clock deviation, and errors per thousand reads."""

    name = "frames"
    title = "Frame rate and bus"
    is_automatic = True
    limit_names = frozenset({"rate", "rate_of_scans", "scan_time", "missed_scans", "clock", "bus_errors", "saturated"})

    def find_unmet_requirement(self, board: BoardUnderTest) -> str:
        """Return "", because the frames phase needs only the board."""
        return ""

    def check_options(self, options: Options) -> None:
        """Check the option of the frames phase, `seconds`: duration of the record."""
        self._take_seconds(options)

    def _take_seconds(self, options: Options) -> float:
        """Take the duration of the record in s from the options; default 2 s."""
        return options.take_number("seconds", 2.0, 0.2, 3600.0)

    def run(self, board: BoardUnderTest, options: Options, log: PhaseLog) -> None:
        """Measure frame rate, scan time and errors of a board over a record, from counters before and after it."""
        seconds = self._take_seconds(options)
        options.refuse_unknown_keys()
        before, (errors_before, reads_before) = board.read_status(), board.readout.read_bus_errors()
        capture = board.read_for(seconds, log)
        after, (errors_after, reads_after) = board.read_status(), board.readout.read_bus_errors()

        def increase(name: str, bits: int = 16) -> int:
            """Return the increase of a status counter of the board during the record; the counter wraps after `bits`
            bits.
            """
            return int((after[name] - before[name]) % 2**bits)

        scan_s = after["scan_time_us"] * 1e-6
        log.measure("rate", capture.rate_hz, "Hz")
        log.measure("scan_time", scan_s * 1e3, "ms")
        log.measure("rate_of_scans", capture.rate_hz * scan_s, "of the scans")
        log.measure("missed_scans", capture.missed_scans, "scans")
        if not isinstance(board.wire, HubWire) and capture.seconds:  # Through a hub, times are already corrected.
            board_seconds = float(capture.board_time_s[-1] - capture.board_time_s[0])
            log.measure("clock", (board_seconds / capture.seconds - 1.0) * 1e6, "ppm")
        reads = max(reads_after - reads_before, 1)
        failed_reads = increase("bus_errors") + increase("rejected_writes") + errors_after - errors_before
        failure_rate = 1e3 * failed_reads / reads
        log.measure("bus_errors", failure_rate, "a thousand reads")
        log.measure("saturated", increase("saturated_conversions"), "conversions")
        log.add_note(f"{increase('scans', 32)} scans, {reads} reads in {capture.seconds:.1f} s")
        limit = log.get_limit("bus_errors")
        if limit is not None and not limit.contains(failure_rate):
            text = f"{failure_rate:.1f} of 1000 reads failed, limit {limit}; check plug and pull-ups"
            board.evidence.board.append(Fault("bus errors", BOARD, text, limit.severity(failure_rate)))
