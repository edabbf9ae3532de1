"""Captures: the hub's bytes as they arrived, with their arrival times. The format is in protocol/SPEC.md."""

import contextlib
import io
import json
import os
import struct
from pathlib import Path
from types import TracebackType
from typing import BinaryIO

from taxel.link.base import Chunk
from taxel.link.errors import CaptureError

MAGIC = b"TAXELCAP"
VERSION = 1
EXISTS = "exists already; choose another name, or ask for it to be overwritten (--overwrite)"
HEADER_MAX = 1 << 20
RECORD_MAX = 1 << 24
_START = struct.Struct("<8sHHI")
_RECORD = struct.Struct("<QI")
RECORD_HEAD = _RECORD.size


class CaptureWriter:
    """Write a capture; each record is handed to the operating system at once, so that a killed program loses nothing
    before it.

    `header` is any JSON object (hand, baud, note); "clock": "hub" in it says that arrival times mean nothing. Raises
    `CaptureError` if the file exists and `overwrite` is False, or cannot be written.
    """

    def __init__(
        self, path: str | os.PathLike[str], header: dict[str, object] | None = None, overwrite: bool = False
    ) -> None:
        self.path = Path(path)
        self.records = 0
        text = json.dumps(header or {}).encode()
        if len(text) > HEADER_MAX:
            raise CaptureError(str(path), f"cannot be written (its header has more than {HEADER_MAX} bytes)")
        try:
            self._file: BinaryIO = open(self.path, "wb" if overwrite else "xb", buffering=0)  # noqa: SIM115
            self._file.write(_START.pack(MAGIC, VERSION, 0, len(text)) + text)
        except FileExistsError:
            raise CaptureError(str(path), EXISTS) from None
        except OSError as error:
            raise CaptureError(str(path), f"cannot be written ({error.strerror})") from error

    def write(self, data: bytes, time_ns: int) -> None:
        """Append bytes that arrived at `time_ns` (nanoseconds, any origin, never going back)."""
        for start in range(0, max(len(data), 1), RECORD_MAX):
            self._append(data[start : start + RECORD_MAX], time_ns)
        self.records += 1

    def _append(self, data: bytes, time_ns: int) -> None:
        record = _RECORD.pack(time_ns, len(data)) + data
        end = self._file.tell()
        try:
            written = self._file.write(record)
            while written < len(record):  # a full disk takes a part, and complains at the next attempt
                written += self._file.write(record[written:])
        except OSError as error:
            with contextlib.suppress(OSError):
                os.ftruncate(self._file.fileno(), end)
            raise CaptureError(
                str(self.path), f"cannot be written ({error.strerror}); what came before is kept"
            ) from error

    def tick(self) -> None:
        """Nothing waits: each record is written at once."""

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def __enter__(self) -> "CaptureWriter":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


class CaptureLink:
    """Read a capture as if its bytes came from a port, as fast as they are asked for.

    Raises `CaptureError` if the file is not a capture, and, after everything before it was read, if the file is cut
    short.
    """

    is_real_time = False
    is_recorded = True
    holds_back = False

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.name = str(path)
        try:
            self._file: io.BufferedReader = open(path, "rb")  # noqa: SIM115
        except OSError as error:
            raise CaptureError(self.name, f"cannot be read ({error.strerror})") from error
        try:
            self.header = self._read_header()
        except CaptureError:
            self._file.close()
            raise
        self.has_arrivals = self.header.get("clock") != "hub"
        baud = self.header.get("baud", 1e6)
        self.baud = float(baud) if isinstance(baud, int | float) and 1e3 <= baud <= 1e9 else 1e6

    def _read_header(self) -> dict[str, object]:
        start = self._file.read(_START.size)
        if len(start) < _START.size or start[:8] != MAGIC:
            raise CaptureError(self.name, "is not a taxel capture (it does not begin with TAXELCAP)")
        _, version, _, size = _START.unpack(start)
        if version != VERSION:
            raise CaptureError(self.name, f"is a capture of version {version}; this program reads version {VERSION}")
        if size > HEADER_MAX:
            raise CaptureError(self.name, "has a damaged header (its length is impossible)")
        try:
            header = json.loads(self._file.read(size))
        except (ValueError, RecursionError):
            raise CaptureError(self.name, "has a damaged header (it is not JSON)") from None
        if not isinstance(header, dict):
            raise CaptureError(self.name, "has a damaged header (it is not a JSON object)")
        return header

    def read(self, timeout_s: float = 0.0) -> Chunk:
        """The next record. Raises EOFError at the end of a whole file."""
        offset = self._file.tell()
        head = self._file.read(_RECORD.size)
        if not head:
            raise EOFError
        if len(head) == _RECORD.size:
            time_ns, size = _RECORD.unpack(head)
            if size > RECORD_MAX:
                raise self.broken(offset, is_cut=False)
            data = self._file.read(size)
            if len(data) == size:
                return Chunk(data, time_ns)
        raise self.broken(offset, is_cut=True)

    def broken(self, offset: int, is_cut: bool) -> CaptureError:
        """What to raise for a record at byte `offset` that is cut short, or damaged."""
        how = "is cut short in a record" if is_cut else "is damaged"
        return CaptureError(self.name, f"{how} at byte {offset}; everything before it was read")

    def read_into(self, buffer: memoryview) -> int:
        """Fill `buffer` with the file's next bytes, heads of records and all; how many, 0 at the end.

        For a reader that takes the records apart itself; not to be mixed with `read`. Raises `CaptureError`.
        """
        try:
            return self._file.readinto(buffer)
        except OSError as error:
            raise CaptureError(self.name, f"cannot be read ({error.strerror})") from error

    @property
    def position(self) -> int:
        """Bytes of the file that were read."""
        return self._file.tell()

    @property
    def bytes_left(self) -> int:
        """Bytes of the file that are still to be read."""
        return max(os.fstat(self._file.fileno()).st_size - self.position, 0)

    def write(self, data: bytes) -> None:
        """Refused: nobody answers in a capture."""
        raise CaptureError(self.name, "is a recording; it takes no commands")

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def __enter__(self) -> "CaptureLink":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
