"""Findings on disk: the mutated files, a description, and the command that repeats each of them."""

from __future__ import annotations

import re
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Final

from fuzz_files.judgement import read_files, write_files
from fuzz_files.mutant import MutantMaker, list_sizes
from fuzz_files.target import Target
from fuzz_files.worker import Task

KEPT: Final = 5
"""Findings of one kind that are stored; the others are counted."""

_NUMBER: Final = re.compile(r"\d+|0x[0-9a-f]+|'[^']*'|\"[^\"]*\"")


class FindingStore:
    """Findings of a campaign, stored below a folder with a folder for each."""

    def __init__(self, folder: Path, targets: Mapping[str, Target]) -> None:
        """Prepare the store. folder: created with the first finding. targets: by name."""
        self.count = 0
        self._folder = folder
        self._targets = targets
        self._kinds: dict[tuple[str, str], list[int]] = {}
        self._texts: dict[tuple[str, str], str] = {}

    def add(self, task: Task, number: int, text: str) -> None:
        """Count the finding of one input, and store the input's files with a description.

        task: task that contains the input. number: number of the input; -1 for the target as a whole. text:
        description. Only the first `KEPT` findings of a kind (same target, message and place in the code) are stored.
        """
        self.count += 1
        kind = (task.target, _NUMBER.sub("N", text.strip().splitlines()[-1])[:120] + _find_place(text))
        numbers = self._kinds.setdefault(kind, [])
        numbers.append(number)
        self._texts.setdefault(kind, text)
        if len(numbers) > KEPT or number < 0:
            return
        own = self._folder / f"{task.target}-{task.seed}-{number}"
        own.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix="taxel-fuzz-") as folder:
            target = self._targets[task.target]
            target.make(Path(folder))
            mutant = MutantMaker(target, read_files(Path(folder))).make(task.seed, number)
        write_files(own, mutant.files)
        command = f"tools/fuzz_files/run.py --seed {task.seed} --reader {task.target} --number {number}"
        lines = [text, f"mutated file: {mutant.name}", f"mutation: {mutant.description}"]
        lines += [f"files: {list_sizes(mutant.files)}", f"repeat: .venv/bin/python {command}"]
        (own / "finding.txt").write_text("\n".join(lines) + "\n", errors="backslashreplace")

    def print_summary(self) -> None:
        """Print each kind of finding with the number of its inputs and the number of the first of them."""
        for (target, _), numbers in sorted(self._kinds.items()):
            text = self._texts[target, _].strip().splitlines()
            head = text[-1] if text[0].startswith("traceback") else text[0]
            print(
                f"{target}: {len(numbers)} x {head[:200]} {_find_place(self._texts[target, _])} (number {numbers[0]})"
            )
        if self._kinds:
            print(f"the files of the findings, and the commands that repeat them, are in {self._folder}")


def _find_place(text: str) -> str:
    """Return the last line of a traceback that lies in the project, as " [file:line]"; "" for a text without one."""
    places = re.findall(r'File "[^"]*/((?:host|tools|hil_tests|protocol)/[^"]+)", line (\d+)', text)
    own = [place for place in places if "fuzz_files" not in place[0]]
    return f" [{own[-1][0]}:{own[-1][1]}]" if own else ""
