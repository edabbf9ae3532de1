"""Main module of the sandboxed process: diagnoses copied files without access to keys or emulator (`isolation.py`).

Standard input: one JSON object per line, {"real", "sim", "without", "seed", "out", "shares_cores"}. The report is
written to `out`. shares_cores: use one core, because other processes use the others.
Standard output: one JSON object per line, {} or {"error": "one line"}.
"""

import json
import sys
from pathlib import Path
from typing import Any

from taxel.blind.isolation import isolate_process
from taxel.blind.version import compute_diagnosis_version


def main(folder: str, *hidden: str) -> int:
    """Run the process that diagnoses worlds without access to the hidden causes, until standard input ends.

    Each line of standard input is a job in JSON; each answer is one line of JSON. folder: the only data that the
    process can read. hidden: folders that are always unreadable. Returns the exit status.
    """
    version = compute_diagnosis_version()  # before the isolation, which removes its module
    fields = {"diagnosis": version, "blindfold": isolate_process(Path(folder), [Path(path) for path in hidden])}
    for line in sys.stdin:
        print(json.dumps(_diagnose(json.loads(line), fields)), flush=True)
    return 0


def _diagnose(job: dict[str, Any], fields: dict[str, str]) -> dict[str, str]:
    """Diagnose the datasets of a job and write the report; returns the error, if any, under the key "error".

    fields: added to the report.
    """
    from taxel.blind.baselines import compute_baseline_verdicts
    from taxel.gap.diagnosis import diagnose
    from taxel.gap.fitting.parallel import use_one_process

    if job["shares_cores"]:
        use_one_process()
    try:
        diagnosis = diagnose(job["real"], job["sim"], job["without"], job["seed"])
        report = {**diagnosis.report, "simpler": compute_baseline_verdicts(diagnosis), **fields}
        Path(job["out"]).write_text(json.dumps(report, allow_nan=False))
    except Exception as error:  # a world on which the diagnosis fails counts as a wrong verdict
        return {"error": f"{type(error).__name__}: {error}"}
    return {}


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
