"""Messages about the gaps in a recording while its port is unplugged."""

import sys
import time

from taxel.link import Gap, Reconnection


class GapNotices:
    """Prints one line on standard error when the port is lost, and one when it is back."""

    def __init__(self, name: str, reconnection: Reconnection | None) -> None:
        """Create notices for the port `name`.

        reconnection: state of the port and list of its gaps; None for a port whose loss ends the program.
        """
        self._name = name
        self._reconnection = reconnection
        self._losses = self._returns = 0

    def update(self) -> str:
        """Print a line for a port that was lost or is back since the last call.

        Returns a note for the progress display, "" while the port is present.
        """
        if self._reconnection is None:
            return ""
        gaps = self._reconnection.gaps
        if len(gaps) > self._losses:
            self._losses = len(gaps)
            problem = self._reconnection.problem
            _print_line(f"{self._name}: {problem}; waiting for it since {format_time(gaps[-1].start_s)}")
        if gaps and gaps[-1].end_s is not None and len(gaps) > self._returns:
            self._returns = len(gaps)
            _print_line(f"{self._name}: is back after {gaps[-1].get_seconds(time.time()):.1f} s")
        return "" if not gaps or gaps[-1].end_s is not None else f"; no data since {format_time(gaps[-1].start_s)}"


def format_gaps(gaps: list[Gap]) -> str:
    """Format gaps as one line: their number, their total duration, and the times of the first ones."""
    now_s = time.time()
    total_s = sum(gap.get_seconds(now_s) for gap in gaps)
    times = ", ".join(
        f"{format_time(gap.start_s)} to {'the end' if gap.end_s is None else format_time(gap.end_s)}"
        for gap in gaps[:3]
    )
    more = ", ..." if len(gaps) > 3 else ""
    return f"gaps: {len(gaps)} without the port, {total_s:.1f} s in total ({times}{more})"


def format_time(unix_s: float) -> str:
    """Format Unix seconds as local time, such as 12:03:04."""
    return time.strftime("%H:%M:%S", time.localtime(unix_s))


def _print_line(text: str) -> None:
    """Print a line of this program to standard error."""
    print(f"taxel: {text}", file=sys.stderr, flush=True)
