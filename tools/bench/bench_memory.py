"""Largest memory of programs over a recording and over one ten times as long: it must not grow with the length."""

import subprocess
import sys
import tempfile
from pathlib import Path

from figures import Figure
from recorded import record

SHORT_S, TIMES = 10.0, 10
GROWTH = 1.1
PROGRAMS = {
    "batch decode": "from taxel.stream import decode_capture\nfor _ in decode_capture(sys.argv[1]): pass",
    "activation over arrays": "from taxel.recording import activity_of\nfor _ in activity_of(sys.argv[1]): pass",
    "replay, frame by frame": "from taxel.skin import open_skin\nfor _ in open_skin('file:' + sys.argv[1]): pass",
    "record": "from pathlib import Path\nsys.path.insert(0, sys.argv[3])\nfrom recorded import record\n"
    "record(Path(sys.argv[1]).parent, float(sys.argv[2]))",
}
_PEAK = (
    "\nimport resource\nprint(max(resource.getrusage(who).ru_maxrss"
    " for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)))"
)


def peak_mb(program: str, capture: Path, seconds: float) -> float:
    """Largest resident memory of a Python program over `capture`, or of what it started; megabytes."""
    arguments = [str(capture), repr(seconds), str(Path(__file__).parent)]
    code = f"import sys\n{program}{_PEAK}"
    done = subprocess.run([sys.executable, "-c", code, *arguments], check=True, capture_output=True, text=True)
    return float(done.stdout) / 1024


def measure() -> list[Figure]:
    """What ten times the length may take over what it takes."""
    figures = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        captures = []
        for length in (SHORT_S, TIMES * SHORT_S):
            place = folder / f"{length:g}"
            place.mkdir()
            captures.append((record(place, length)[0], length))
        for what, program in PROGRAMS.items():
            short, long = (peak_mb(program, capture, length) for capture, length in captures)
            figures.append(
                Figure(
                    f"memory, {what}",
                    GROWTH * short / long,
                    1.0,
                    f"{GROWTH:g} times that of a tenth of the length",
                    f"{long:.0f} MB over {TIMES * SHORT_S:g} s, {short:.0f} MB over {SHORT_S:g} s",
                )
            )
    return figures
