"""The other process: it diagnoses copied files, and can see neither keys nor emulator (`blindfold.py`).

One JSON object a line on standard input: {"real", "sim", "without", "seed", "out"}; the report goes to `out`, one line
of JSON to standard output: {} or {"error": "one line"}.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

from taxel.blind.blindfold import blindfold
from taxel.blind.version import diagnosis_version


def main(folder: str, *sealed: str) -> int:
    """Serve requests until standard input ends. folder: the only one that is seen; sealed: never."""
    told = {"diagnosis": diagnosis_version(), "blindfold": blindfold(Path(folder), [Path(path) for path in sealed])}
    for line in sys.stdin:
        print(json.dumps(_answer(json.loads(line), told)), flush=True)
    return 0


def _answer(job: dict[str, Any], told: dict[str, str]) -> dict[str, str]:
    from taxel.blind.simpler import simpler_answers
    from taxel.gap.diagnosis import diagnose

    try:
        done = diagnose(job["real"], job["sim"], job["without"], job["seed"])
        report = {**done.report, "simpler": simpler_answers(done), **told}
        Path(job["out"]).write_text(json.dumps(report, allow_nan=False))
    except Exception as error:  # a world that breaks the diagnosis is a wrong answer, and the check goes on
        return {"error": f"{type(error).__name__}: {error}"}
    return {}


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
