"""Decoders of the clients in other languages, compared with the Python batch decode of the same capture."""

import ctypes
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "clients"))

from captures import record_capture
from figures import Figure, compare
from programs import ProgramMissingError, compile_cpp

from taxel.skin.skin import FrameFormat
from taxel.stream import decode_capture

VIRTUAL_S = 60.0
KINDS: tuple[FrameFormat, ...] = ("plain", "compact")
REFERENCE = "Python batch decode"


def _load_client() -> ctypes.CDLL:
    """Load the C++ client as a library. Raises ProgramMissingError."""
    source = Path(__file__).parents[1] / "clients" / "bench_decode.cpp"
    library = ctypes.CDLL(str(compile_cpp(source, "bench-decode", ["-O3", "-fPIC", "-shared"])))
    library.taxel_client_decode.restype = ctypes.c_uint64
    return library


def measure() -> list[Figure]:
    """Run the benchmark of the C++ client, relative to batch decoding in Python.

    Both read and decode a 60 s capture and count losses. No ratio if the compiler is missing.
    """
    try:
        library = _load_client()
    except ProgramMissingError as error:
        return [Figure("C++ client, capture decode", None, None, REFERENCE, str(error))]
    with tempfile.TemporaryDirectory() as folder:
        return [_compare(library, Path(folder, f"{kind}.bin"), kind) for kind in KINDS]


def _compare(library: ctypes.CDLL, path: Path, kind: FrameFormat) -> Figure:
    """Compare both decoders on a recorded capture of one frame format."""
    record_capture(path, VIRTUAL_S, kind)
    batches = list(decode_capture(path))
    frames = sum(len(batch.taxel_rows) + len(batch.message_rows) for batch in batches)
    counts = ctypes.c_uint64(0)

    def decode_with_client() -> None:
        """Decode the file with the C++ client."""
        counts.value = 0
        assert library.taxel_client_decode(str(path).encode(), ctypes.byref(counts)) == frames

    def decode_with_python() -> None:
        """Decode the file in Python batches, without use of the results."""
        for _ in decode_capture(path):
            pass

    comparison = compare(decode_with_client, decode_with_python)
    assert counts.value == sum(len(batch.counts) for batch in batches)
    size = path.stat().st_size / 1e6
    rates = f"{size / comparison.measured_s:,.0f} against {size / comparison.reference_s:,.0f} MB/s"
    detail = f"{frames} frames, {size:.1f} MB, file read included: {rates}"
    return Figure(f"C++ client, capture decode, {kind} frames", comparison.ratio, 1.0, REFERENCE, detail)
