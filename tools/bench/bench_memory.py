"""Peak memory of programs on a recording and on a recording ten times as long: the memory must not grow with the
length.
"""

import subprocess
import sys
import tempfile
from pathlib import Path

from figures import Figure
from recordings import record

SHORT_S, LENGTH_RATIO = 10.0, 10
GROWTH_MAX = 1.1
PROGRAMS = {
    "batch decode": "from taxel.stream import decode_capture\nfor _ in decode_capture(sys.argv[1]): pass",
    "activation over arrays": "from taxel.recording import read_activity\nfor _ in read_activity(sys.argv[1]): pass",
    "replay, frame by frame": "from taxel.skin import open_skin\nfor _ in open_skin('file:' + sys.argv[1]): pass",
    "record": "from pathlib import Path\nsys.path.insert(0, sys.argv[3])\nfrom recordings import record\n"
    "record(Path(sys.argv[1]).parent, float(sys.argv[2]))",
}
_PEAK = (
    "\nimport resource\nprint(max(resource.getrusage(who).ru_maxrss"
    " for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)))"
)


def measure_peak_mb(program: str, capture: Path, seconds: float) -> float:
    """Measure the peak resident memory of a Python program in MB.

    program: source text, run with `capture` and `seconds` as arguments. The larger of the program and its child
    processes counts.
    """
    arguments = [str(capture), repr(seconds), str(Path(__file__).parent)]
    code = f"import sys\n{program}{_PEAK}"
    completed = subprocess.run([sys.executable, "-c", code, *arguments], check=True, capture_output=True, text=True)
    return float(completed.stdout) / 1024


def measure() -> list[Figure]:
    """Run the benchmark of memory, on a recording and on one of ten times the length.

    The ratio is the allowed peak memory for the long recording, divided by the measured peak memory.
    """
    figures = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        captures = []
        for length in (SHORT_S, LENGTH_RATIO * SHORT_S):
            subfolder = folder / f"{length:g}"
            subfolder.mkdir()
            captures.append((record(subfolder, length)[0], length))
        for program_name, program in PROGRAMS.items():
            short, long = (measure_peak_mb(program, capture, length) for capture, length in captures)
            figures.append(
                Figure(
                    f"memory, {program_name}",
                    GROWTH_MAX * short / long,
                    1.0,
                    f"{GROWTH_MAX:g} times the memory of the short recording",
                    f"{long:.0f} MB over {LENGTH_RATIO * SHORT_S:g} s, {short:.0f} MB over {SHORT_S:g} s",
                )
            )
    return figures
