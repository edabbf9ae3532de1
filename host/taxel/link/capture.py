"""Capture files: received bytes with their arrival times. The format is specified in protocol/SPEC.md."""

import json
import os
import struct
from pathlib import Path
from types import TracebackType

from taxel.input_files import TextError, open_regular_file, parse_json
from taxel.link.base import Chunk
from taxel.link.errors import CaptureError
from taxel.link.live_records import LiveRecords
from taxel.link.recording_header import check_recording_header
from taxel.output import LiveOutput

MAGIC = b"TAXELCAP"
VERSION = 1
HEADER_MAX = 1 << 20
RECORD_MAX = 1 << 24
_START = struct.Struct("<8sHHI")
_RECORD = struct.Struct("<QI")
RECORD_HEAD = _RECORD.size


class CaptureWriter:
    """Writer of a capture file.

    Each record is passed to the operating system at once, so a killed process loses no record.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        header: dict[str, object] | None = None,
        overwrite: bool = False,
        output: LiveOutput | None = None,
    ) -> None:
        """Create a capture file and write its header.

        header: any JSON object, such as hand, baud and note; None: {}. "clock": "hub" in the header states that the
        arrival times are not real. output: open output that is written instead of `path`; None: a new file, which
        replaces an existing one with its first record. Raises CaptureError if the file exists and `overwrite` is False,
        if another program writes it, if the header is too long, or if the system refuses.
        """
        self.path = Path(path)
        self.records = 0
        text = json.dumps(header or {}).encode()
        if len(text) > HEADER_MAX:
            raise CaptureError(str(path), f"cannot be written (its header has more than {HEADER_MAX} bytes)")
        start = _START.pack(MAGIC, VERSION, 0, len(text)) + text
        self._file = LiveRecords(path, start, overwrite, output, "records")

    def write(self, data: bytes, time_ns: int) -> None:
        """Append bytes that arrived at `time_ns` (nanoseconds from any origin, not decreasing) as one record.

        More than `RECORD_MAX` bytes are divided into several records of the file; `records` still counts them as one.
        Raises `CaptureError`.
        """
        for start in range(0, max(len(data), 1), RECORD_MAX):
            piece = data[start : start + RECORD_MAX]
            self._file.append(_RECORD.pack(time_ns, len(piece)) + piece)
        self.records += 1

    @property
    def size(self) -> int:
        """Size of the capture file so far, bytes."""
        return self._file.size

    def read_data(self, offset: int, size: int) -> bytes:
        """Return the first `size` bytes of the data of the record at byte `offset` of the file.

        Raises `CaptureError`.
        """
        return self._file.read_at(offset + RECORD_HEAD, size)

    def truncate(self, size: int) -> None:
        """Remove all records behind the first `size` bytes; the argument is an earlier value of the property `size`.

        Raises `CaptureError`.
        """
        self._file.truncate(size)

    def tick(self) -> None:
        """Do nothing: each record is written at once."""

    def close(self) -> None:
        """Flush the capture file to the disk and close it. A second call has no effect.

        A capture without records does not replace an existing one. Raises `CaptureError`.
        """
        self._file.close(has_records=self.records > 0)

    def discard(self) -> None:
        """Close the file; remove a capture without records."""
        if self.records:
            self.close()
        else:
            self._file.discard()

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

        `has_arrivals` is False if the header states that the arrival times are not real. `baud` is the baud rate in the
        header, or 1 Mbit/s if the header has no plausible rate.
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

        Returns 0 at the end. For callers that parse the records themselves; not to be combined with `read`. Raises
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
