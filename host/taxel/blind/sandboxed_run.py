"""The sandboxed diagnosing process, controlled from the process that holds the keys."""

import contextlib
import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from taxel.blind.errors import BlindRunError
from taxel.output import write_whole


class SandboxedRunner:
    """A process that diagnoses copies of datasets in its own temporary folder.

    hidden: a folder that the process can never read, such as that of the check.
    """

    def __init__(self, hidden: Path, shares_cores: bool = False) -> None:
        """Start a separate process that diagnoses datasets without access to the hidden causes.

        hidden: folder of the blind check, which the process cannot read. shares_cores: whether other such processes run
        at the same time; a diagnosis then uses one core.
        """
        self._shares_cores = shares_cores
        self._folder = Path(tempfile.mkdtemp(prefix="taxel-blind-"))
        command = [sys.executable, "-m", "taxel.blind.diagnosis_process", str(self._folder), str(hidden.resolve())]
        environment = {key: os.environ[key] for key in ("PATH", "HOME", "LANG") if key in os.environ}
        # One thread: threads that start before the isolation would not be restricted.
        environment |= dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
        self._process = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            cwd=self._folder,
            env=environment,
            start_new_session=True,  # Ctrl-C reaches only the parent, which ends this process after its answer
        )

    def diagnose(self, real: Path, sim: Path, out: Path, without: Sequence[str] = (), seed: int = 0) -> None:
        """Diagnose copies of `real` and `sim` and write the report to `out`; a failure is written as {"error": ...}.

        without: names of effects that are removed from the catalogue. seed: of the analysis. Raises BlindRunError if
        the process has ended.
        """
        for name, path in (("real.h5", real), ("sim.h5", sim)):
            shutil.copyfile(path, self._folder / name)
        names = {"real": "real.h5", "sim": "sim.h5", "out": "report.json"}
        job: dict[str, Any] = {key: str(self._folder / name) for key, name in names.items()}
        (self._folder / "report.json").unlink(missing_ok=True)
        settings = {"without": list(without), "seed": seed, "shares_cores": self._shares_cores}
        answer = json.loads(self._request(json.dumps({**job, **settings})))
        if answer:  # an error; the answer {} means that the process has written a report
            write_whole(out, json.dumps(answer))
        else:
            write_whole(out, (self._folder / "report.json").read_bytes())

    def _request(self, line: str) -> str:
        """Send one line to the diagnosing process and return its answer.

        Raises BlindRunError if the process has ended.
        """
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        try:
            self._process.stdin.write(line + "\n")
            self._process.stdin.flush()
            answer = self._process.stdout.readline()
        except BrokenPipeError:
            answer = ""
        if not answer:
            raise BlindRunError("diagnosing process", "an answer", "its end", "run the same command again to resume")
        return answer

    def close(self) -> None:
        """End the diagnosing process and delete its folder."""
        with contextlib.suppress(BrokenPipeError):
            self._process.communicate()
        shutil.rmtree(self._folder, ignore_errors=True)
