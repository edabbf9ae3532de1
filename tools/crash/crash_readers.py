"""Readers of the fault campaign: the content of an output as a value that can be compared.

A reader raises an exception if the output is unreadable. The readers of recordings omit an incomplete last record.
"""

import hashlib
import sqlite3
from pathlib import Path

import h5py
import numpy as np

from taxel.blind.run_folder import open_sealed_worlds
from taxel.link import CaptureLink
from taxel.link.pcapng_link import PcapngLink
from taxel.recording.formats import open_recording
from taxel.skin import Skin


def compute_digest(*parts: bytes) -> str:
    """Return the first 16 hexadecimal digits of the SHA-256 of the parts, joined by zero bytes."""
    return hashlib.sha256(b"\0".join(parts)).hexdigest()[:16]


def read_bytes(path: Path) -> str:
    """Return the digest of a file's bytes, or of the names and bytes of all files in a folder."""
    if path.is_dir():
        return compute_digest(
            *(part for file in sorted(path.iterdir()) for part in (file.name.encode(), file.read_bytes()))
        )
    return compute_digest(path.read_bytes())


def read_hdf5(path: Path) -> tuple[str, ...]:
    """Return the digests of the arrays in an HDF5 file, in the order of their names."""
    found: dict[str, str] = {}

    def visit(name: str, node: object) -> None:
        if isinstance(node, h5py.Dataset):
            # as text, because the array of a string dataset contains only references to its strings
            found[name] = compute_digest(name.encode(), np.asarray(node[()]).astype("S").tobytes())

    with h5py.File(path, "r", locking=False) as file:
        file.visititems(visit)
    return tuple(found[name] for name in sorted(found))


def read_grasps(path: Path) -> tuple[str, ...]:
    """Return the digest of the raw counts of each grasp in a dataset, in order of the grasps' names."""
    with h5py.File(path, "r", locking=False) as file:
        return tuple(
            compute_digest(name.encode(), file["grasps"][name]["raw_counts"][()].tobytes()) for name in file["grasps"]
        )


def read_frames(path: Path) -> str:
    """Return one digest of all frames of a recording."""
    link, hand = open_recording(path)
    with Skin(link, hand) as skin:
        return compute_digest(*(frame.raw_counts.tobytes() + bytes([frame.address]) for frame in skin))


def read_capture(path: Path) -> tuple[str, ...]:
    """Return the digest of each complete record of a capture; an incomplete last record is omitted."""
    with CaptureLink(path) as link:
        return read_chunks(link)


def read_chunks(link: CaptureLink | PcapngLink) -> tuple[str, ...]:
    """Return the digest of each chunk of an open recording, up to its end or up to an incomplete record."""
    found: list[str] = []
    while True:
        try:
            found.append(compute_digest(link.read().data))
        except (EOFError, ValueError):
            return tuple(found)
        except Exception as error:
            if "cut short" not in str(error):
                raise
            return tuple(found)


def read_pcapng(path: Path) -> tuple[str, ...]:
    """Return the digest of each complete packet of a PCAPNG file; an incomplete last packet is omitted."""
    with PcapngLink(path) as link:
        return read_chunks(link)


def read_mcap(path: Path) -> tuple[str, ...]:
    """Return the digest of each complete message of an MCAP file, read from front to back."""
    from mcap.records import Message
    from mcap.stream_reader import StreamReader

    found: list[str] = []
    with path.open("rb") as stream:
        records = StreamReader(stream, emit_chunks=False).records
        while True:
            try:
                record = next(records)
            except StopIteration:
                return tuple(found)
            except Exception as error:
                if type(error).__name__ not in ("EndOfFile", "RecordLengthLimitExceeded", "struct.error", "error"):
                    raise
                return tuple(found)
            if isinstance(record, Message):
                found.append(compute_digest(record.data))


def read_lines(path: Path) -> tuple[str, ...]:
    """Return the complete lines of a text file; an incomplete last line is omitted."""
    text = path.read_text()
    return tuple(text[: text.rfind("\n") + 1].splitlines())


def read_history(folder: Path) -> tuple[str, ...]:
    """Return the serial numbers of the tests in a history, after an integrity check of the database."""
    connection = sqlite3.connect(folder / "history.sqlite")
    try:
        assert connection.execute("PRAGMA integrity_check").fetchone() == ("ok",)
        return tuple(row[0] for row in connection.execute("SELECT serial_number FROM run ORDER BY id"))
    finally:
        connection.close()


def read_tests(folder: Path) -> tuple[str, ...]:
    """Return the names of the bench-test folders that have their final name.

    Raises AssertionError if such a folder does not contain exactly the three reports.
    """
    done = sorted(path for path in (folder / "tests").iterdir() if not path.name.startswith("."))
    for path in done:
        assert {file.name for file in path.iterdir()} == {"report.html", "result.json", "junit.xml"}, path
    return tuple(path.name for path in done)


def read_seal(folder: Path) -> int:
    """Return the number of sealed worlds, each verified against its commitment; 0 without the file of keys."""
    return len(open_sealed_worlds(folder / "check")) if (folder / "check" / "sealed" / "keys.json").exists() else 0
