"""Capture files: received bytes with their arrival times. The format is specified in protocol/SPEC.md."""

import contextlib
import json
import os
import struct
from pathlib import Path
from types import TracebackType
from typing import NoReturn

from taxel.input_files import TextError, open_regular_file, parse_json
from taxel.link.base import Chunk
from taxel.link.errors import CaptureError
from taxel.link.recording_header import check_recording_header
from taxel.output import LiveOutput, OutputError

MAGIC = b"TAXELCAP"
VERSION = 1
EXISTS = "exists already; choose another name, or overwrite the file (--overwrite)"
HEADER_MAX = 1 << 20
RECORD_MAX = 1 << 24
_START = struct.Struct("<8sHHI")
_RECORD = struct.Struct("<QI")
RECORD_HEAD = _RECORD.size


def open_live_output(path: str | os.PathLike[str], overwrite: bool) -> LiveOutput:
    """Create a recording that is readable while it is written.

    Raises CaptureError if it exists and `overwrite` is False, if another program writes it, or if the system refuses.
    """
    if os.path.exists(path) and not overwrite:
        raise CaptureError(os.fspath(path), EXISTS)
    try:
        return LiveOutput(path, overwrite=overwrite)
    except OutputError as error:
        problem = f"expected {error.expected}, found {error.found}; {error.remedy}"
        raise CaptureError(os.fspath(path), problem) from None
    except OSError as error:
        raise CaptureError(os.fspath(path), f"cannot be written ({error.strerror})") from error


class CaptureWriter:
    """Writer of a capture file. Each record is passed to the operating system at once: no record is lost with the
    process.

    header: any JSON object (hand, baud, note); "clock": "hub" states that the arrival times are not valid. Raises
    `CaptureError` if the file exists and `overwrite` is False, if another program writes it, or if the system refuses.
    """

    _has_failed = False

    def __init__(
        self,
        path: str | os.PathLike[str],
        header: dict[str, object] | None = None,
        overwrite: bool = False,
        output: LiveOutput | None = None,
    ) -> None:
        """Create a capture file and write its header.

        header: any JSON object, such as hand, baud and note; None: {}. output: open output that is written instead of
        `path`; None: a new file, which replaces an existing one with its first record. Raises CaptureError if the file
        exists and `overwrite` is False, if the header is too long, or if the file cannot be written.
        """
        self.path = Path(path)
        self.records = 0
        text = json.dumps(header or {}).encode()
        if len(text) > HEADER_MAX:
            raise CaptureError(str(path), f"cannot be written (its header has more than {HEADER_MAX} bytes)")
        self._output = open_live_output(path, overwrite) if output is None else output
        self._file = self._output.file
        try:
            self._write_all(_START.pack(MAGIC, VERSION, 0, len(text)) + text)
            self._output.begin()
        except OutputError:
            self._output.discard()
            raise CaptureError(str(path), EXISTS) from None
        except OSError as error:
            self._output.discard()
            raise CaptureError(str(path), f"cannot be written ({error.strerror})") from error

    def write(self, data: bytes, time_ns: int) -> None:
        """Append bytes that arrived at `time_ns` (nanoseconds from any origin, not decreasing)."""
        for start in range(0, max(len(data), 1), RECORD_MAX):
            self._append(data[start : start + RECORD_MAX], time_ns)
        self.records += 1

    def _append(self, data: bytes, time_ns: int) -> None:
        """Write one record to the capture file; after a failure the file is truncated to its complete records.

        time_ns: arrival time of `data`, nanoseconds. Raises `CaptureError`.
        """
        end = self._file.tell()
        try:
            self._write_all(_RECORD.pack(time_ns, len(data)) + data)
        except OSError as error:
            with contextlib.suppress(OSError):
                os.ftruncate(self._file.fileno(), end)
            self._fail(error)
        try:
            self._output.publish()
        except OSError as error:
            self._fail(error)

    def _fail(self, error: OSError) -> NoReturn:
        """Raise `CaptureError` for a failed write; the file then contains the complete records before it."""
        self._has_failed = True
        problem = f"cannot be written ({error.strerror}); the records before are complete"
        raise CaptureError(str(self.path), problem + self._output.describe_previous()) from error

    def _write_all(self, data: bytes) -> None:
        """Write bytes to the capture file. A full disk accepts a part of them, and fails at the next attempt."""
        written = self._file.write(data) or 0
        while written < len(data):
            written += self._file.write(data[written:]) or 0

    @property
    def size(self) -> int:
        """Size of the capture file so far, bytes."""
        return self._file.tell()

    def read_data(self, offset: int, size: int) -> bytes:
        """Return the first `size` bytes of the data of the record at byte `offset` of the file.

        Raises `CaptureError`.
        """
        try:
            return os.pread(self._file.fileno(), size, offset + RECORD_HEAD)
        except OSError as error:
            self._fail(error)

    def truncate(self, size: int) -> None:
        """Remove the records after the first `size` bytes of the file, a value that `size` had before.

        Raises `CaptureError`.
        """
        try:
            self._file.truncate(size)
        except OSError as error:
            self._fail(error)
        self._file.seek(size)

    def tick(self) -> None:
        """Do nothing: each record is written at once."""

    def close(self) -> None:
        """Flush the capture file to the disk and close it. A second call has no effect.

        A capture without records does not replace an existing one. Raises `CaptureError`.
        """
        try:
            if self._has_failed:
                self._output.fail()
            elif self.records or self._output.is_published:
                self._output.close()
            else:
                self._output.discard()
        except OSError as error:
            raise CaptureError(str(self.path), f"cannot be written ({error.strerror})") from error

    def discard(self) -> None:
        """Close the file; remove a capture without records."""
        if self.records:
            self.close()
        else:
            self._output.discard()

    def __enter__(self) -> "CaptureWriter":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close the capture file at the end of the `with` block."""
        self.close()


class CaptureLink:
    """A capture file as a link: each `read` returns the next record without waiting.

    Raises `CaptureError` if the file is not a capture. An interrupted file raises `CaptureError` after all complete
    records are read.
    """

    is_real_time = False
    is_recorded = True
    has_flow_control = False

    def __init__(self, path: str | os.PathLike[str]) -> None:
        """Open a capture file for reading and read its header; raise CaptureError if the file is not a capture.

        `has_arrivals` is False if the header states that the arrival times are not valid. `baud` is the baud rate in
        the header, or 1 Mbit/s if the header has no plausible rate.
        """
        self.name = str(path)
        try:
            self._file = open_regular_file(path)
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
        """Read the JSON object at the start of the capture file.

        Raises `CaptureError` for a file that is no capture.
        """
        start = self._file.read(_START.size)
        if len(start) < _START.size or start[:8] != MAGIC:
            raise CaptureError(self.name, "is not a taxel capture (it does not begin with TAXELCAP)")
        _, version, _, size = _START.unpack(start)
        if version != VERSION:
            raise CaptureError(self.name, f"is a capture of version {version}; this program reads version {VERSION}")
        if size > HEADER_MAX:
            raise CaptureError(self.name, "has a damaged header (its length is impossible)")
        try:
            return check_recording_header(parse_json(self._file.read(size), HEADER_MAX))
        except TextError as error:
            raise CaptureError(self.name, f"has a damaged header ({error})") from None

    def read(self, timeout_s: float = 0.0) -> Chunk:
        """Return the next record of the capture file: its bytes and arrival time.

        The call does not wait; `timeout_s` has no effect. Raises EOFError at the end of a complete file, `CaptureError`
        for a damaged record.
        """
        offset = self._file.tell()
        head = self._file.read(_RECORD.size)
        if not head:
            raise EOFError
        if len(head) == _RECORD.size:
            time_ns, size = _RECORD.unpack(head)
            if size > RECORD_MAX:
                raise self.make_damage_error(offset, is_interrupted=False)
            data = self._file.read(size)
            if len(data) == size:
                return Chunk(data, time_ns)
        raise self.make_damage_error(offset, is_interrupted=True)

    def make_damage_error(self, offset: int, is_interrupted: bool) -> CaptureError:
        """Create the error for the record at byte `offset` of the capture file.

        is_interrupted: the file ends within the record; otherwise the record is damaged.
        """
        problem = "is cut short in a record" if is_interrupted else "is damaged"
        return CaptureError(self.name, f"{problem} at byte {offset}; everything before it was read")

    def read_into(self, buffer: memoryview) -> int:
        """Fill `buffer` with the next bytes of the capture file, including the headers of records; return their number.

        Returns 0 at the end. For a caller that parses the records; not to be combined with `read`. Raises
        `CaptureError`.
        """
        try:
            return self._file.readinto(buffer)
        except OSError as error:
            raise CaptureError(self.name, f"cannot be read ({error.strerror})") from error

    @property
    def position(self) -> int:
        """Number of bytes of the capture file that have been read."""
        return self._file.tell()

    @property
    def remaining_bytes(self) -> int:
        """Number of bytes of the capture file that have not been read yet."""
        return max(os.fstat(self._file.fileno()).st_size - self.position, 0)

    def write(self, data: bytes) -> None:
        """Raise `CaptureError`: a capture accepts no commands."""
        raise CaptureError(self.name, "is a recording; it takes no commands")

    def close(self) -> None:
        """Close the capture file."""
        self._file.close()

    def __enter__(self) -> "CaptureLink":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close the capture file at the end of the `with` block."""
        self.close()
