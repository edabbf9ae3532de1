"""The process that diagnoses, seen from the one that seals."""

from __future__ import annotations

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


class Lane:
    """One process that diagnoses, in a folder of its own, what is copied there. out: what it never sees."""

    def __init__(self, out: Path) -> None:
        self._folder = Path(tempfile.mkdtemp(prefix="taxel-blind-"))
        command = [sys.executable, "-m", "taxel.blind.diagnosing", str(self._folder), str(out.resolve())]
        environment = {key: os.environ[key] for key in ("PATH", "HOME", "LANG") if key in os.environ}
        # One thread: others, begun before the blindfold is on, would not wear it.
        environment |= dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
        self._process = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            cwd=self._folder,
            env=environment,
            start_new_session=True,  # Ctrl-C is for the process that seals, which ends this one after its answer
        )

    def diagnose(self, real: Path, sim: Path, out: Path, without: Sequence[str] = (), seed: int = 0) -> None:
        """Copies in, the report out. What goes wrong is an answer too: {"error": ...}.

        Raises BlindRunError if the process has ended.
        """
        for name, path in (("real.h5", real), ("sim.h5", sim)):
            shutil.copyfile(path, self._folder / name)
        names = {"real": "real.h5", "sim": "sim.h5", "out": "report.json"}
        job: dict[str, Any] = {key: str(self._folder / name) for key, name in names.items()}
        (self._folder / "report.json").unlink(missing_ok=True)
        answer = json.loads(self._asked(json.dumps({**job, "without": list(without), "seed": seed})))
        if answer:
            out.write_text(json.dumps(answer))
        else:
            shutil.copyfile(self._folder / "report.json", out)

    def _asked(self, line: str) -> str:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        try:
            self._process.stdin.write(line + "\n")
            self._process.stdin.flush()
            answer = self._process.stdout.readline()
        except BrokenPipeError:
            answer = ""
        if not answer:
            raise BlindRunError("diagnosing process", "an answer", "its end", "run the same command to go on")
        return answer

    def close(self) -> None:
        """Ends it."""
        with contextlib.suppress(BrokenPipeError):
            self._process.communicate()
        shutil.rmtree(self._folder, ignore_errors=True)
