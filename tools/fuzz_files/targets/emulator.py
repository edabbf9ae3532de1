"""Target: world and stimulus files, which the emulator, a program in C, reads."""

from __future__ import annotations

import re
import struct
import subprocess
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from fuzz_files.document import Flat
from fuzz_files.target import Rules, Target
from fuzz_files.text_codecs import Words
from taxel.errors import TaxelError
from taxel.hand import load_hand
from taxel.hand.world import WorldSettings, format_world
from taxel.link import write_stimulus
from taxel.link.emulator import find_emulator_program

HAND: Final = "flat8"
_HEADER: Final = struct.Struct("<8sIIII")
_SECONDS: Final = "0.02"
_TIMEOUT_S: Final = 8.0


class EmulatorInputError(TaxelError):
    """The emulator has refused a file with one line."""


@dataclass(frozen=True)
class Stimulus:
    """Stimulus files (firmware/emulator/skin/stimulus.h): a header, and records of a time and a value of each taxel."""

    is_strict: bool = False

    def decode(self, data: bytes) -> Any:
        """Return the header and the records: time, and a value for each taxel."""
        magic, version, kind, taxels, reserved = _HEADER.unpack_from(data)
        row_type = np.dtype([("time", "<f8"), ("values", "<f4", (taxels,))])
        records = np.frombuffer(data[_HEADER.size :], row_type)
        rows = [{"time": row["time"].item(), "values": row["values"].copy()} for row in records]
        return {
            "magic": magic, "version": version, "kind": kind, "taxels": taxels, "reserved": reserved, "records": rows
        }  # fmt: skip

    def encode(self, document: Any) -> bytes:
        """Return the bytes of the file."""
        names = ("magic", "version", "kind", "taxels", "reserved")
        rows = [
            struct.pack("<d", row["time"]) + np.asarray(row["values"], "<f4").tobytes() for row in document["records"]
        ]
        return _HEADER.pack(*(document[name] for name in names)) + b"".join(rows)


def write_world(folder: Path) -> str:
    """Write the world and the stimulus of a small skin; returns ".", as the emulator reads the whole folder."""
    hand = load_hand(HAND)
    (folder / "world.txt").write_text(format_world(hand, WorldSettings()))
    write_stimulus(folder / "a.stm", [0.0, 0.01, 0.02], np.full((3, hand.n_taxels), 0.5))
    return "."


def run_emulator(path: Path) -> Flat:
    """Run the emulator on the files of a folder; the data are its exit status.

    Raises EmulatorInputError for a file that it refuses with one line, and RuntimeError for a crash or other output.
    """
    command = [str(find_emulator_program()), "--world", str(path / "world.txt"), "--stimulus", str(path / "a.stm")]
    command += ["--fast", "--duration", _SECONDS, "--uart", "none"]
    completed = subprocess.run(command, capture_output=True, timeout=_TIMEOUT_S, check=False, stdin=subprocess.DEVNULL)
    lines = completed.stderr.decode(errors="replace").splitlines()
    if completed.returncode == 0:
        return {"status": 0}
    if completed.returncode < 0 or len(lines) != 1:
        raise RuntimeError(f"status {completed.returncode}, {len(lines)} lines on standard error: {lines[:1]}")
    raise EmulatorInputError(lines[0])


TARGETS: Final = (
    Target(
        "emulator",
        write_world,
        ((r"\.stm$", (Stimulus(),)), (r"world\.txt$", (Words(),))),
        run_emulator,
        0.1,
        Rules(unused=re.compile("")),
    ),
)
