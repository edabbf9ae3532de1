"""Compare all clients with the Python decoder on captures of the emulated hand, intact and damaged.

    python tools/clients/compare.py [--seconds 60] [--seed 1]

Prints one row for each capture and client: frames, frames lost on the wire, missing frames, and whether every line is
equal. Exit status 1 if a client differs. A client whose compiler or interpreter is missing is left out, with one line.
"""

import argparse
import re
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

from captures import damage, record_capture, write_capture
from kaitai_frames import format_frames, interpret, read_records, shorten
from programs import LANGUAGES, ProgramMissingError, build_program, run_dissector, run_program
from reference import TO_HOST, Stream, format_stream, read_stream

from taxel.recording.formats import convert
from taxel.skin.skin import FrameFormat

KINDS: tuple[FrameFormat, ...] = ("plain", "compact")
DISSECTED = ("taxel.sequence", "taxel.lost", "taxel.missing", "taxel.counts")


class Capture(NamedTuple):
    """A capture file, and its frames and losses by the Python decoder, one line each."""

    name: str
    path: Path
    expected: list[str]


def make_captures(folder: Path, seconds: float, seed: int) -> Iterator[Capture]:
    """Record the emulated hand in both frame formats; yield each capture intact and damaged."""
    for kind in KINDS:
        path = folder / f"{kind}.bin"
        record_capture(path, seconds, kind)
        stream = read_stream(path)
        damaged = damage(stream, seed)
        # The damaged stream ends with a delimiter, because the dissector shows no frame behind the last delimiter.
        for name, data in ((kind, stream), (f"{kind}, damaged", damaged[: damaged.rindex(b"\0") + 1])):
            write_capture(path, data)
            yield Capture(name, path, format_stream(Stream(name, TO_HOST, data), has_wire=False))


def _pick(lines: list[str], name: str) -> list[str]:
    """Return the values of a field in the lines that have it."""
    return [value for line in lines for value in re.findall(rf" {name}=(\S*)", line) if value]


def _run_client(language: str, capture: Capture) -> tuple[list[str], list[str]]:
    """Run a client on a capture, and return its lines and the expected lines."""
    return run_program([*build_program(language, is_optimised=True), "capture", str(capture.path)]), capture.expected


def _run_kaitai(capture: Capture) -> tuple[list[str], list[str]]:
    """Decode a capture by the Kaitai description, and return its lines and the expected lines.

    Both omit the content of compact snapshots.
    """
    lines = format_frames(interpret("taxel_stream"), read_records(interpret("taxel_capture"), capture.path))
    return [line.partition(" data=")[0] for line in lines], shorten(capture.expected)


def _run_tshark(capture: Capture) -> tuple[list[str], list[str]]:
    """Dissect a capture with tshark, and return the found and the expected values.

    The values are all sequences, then all lost frames, missing frames and counts.
    """
    target = capture.path.with_suffix(".pcapng")
    convert(capture.path, target, overwrite=True)
    packets = run_dissector(target, DISSECTED)
    found = [value for i in range(len(DISSECTED)) for packet in packets for value in packet[i].split(";") if value]
    frames = [line for line in capture.expected if line.startswith("frame ")]
    return found, [value for name in DISSECTED for value in _pick(frames, name.removeprefix("taxel."))]


def list_clients() -> dict[str, Callable[[Capture], tuple[list[str], list[str]]]]:
    """Return for each client, by name, a function from a capture to the found and the expected lines."""
    clients: dict[str, Callable[[Capture], tuple[list[str], list[str]]]] = {}
    for language in LANGUAGES:
        clients[language] = lambda capture, language=language: _run_client(language, capture)  # type: ignore[misc]
    return clients | {"tshark": _run_tshark, "kaitai": _run_kaitai}


def main() -> int:
    """Compare all clients on all captures. Returns the exit status: 1 if a client differs, otherwise 0."""
    parser = argparse.ArgumentParser(description="Compare all clients with the Python decoder.")
    parser.add_argument("--seconds", type=float, default=60.0, help="virtual time of each capture (60)")
    parser.add_argument("--seed", type=int, default=1, help="seed of the damage (1)")
    options = parser.parse_args()
    clients = list_clients()
    status = 0
    print(f"{'capture':<18}{'client':<8}{'frames':>8}{'lost':>8}{'missing':>9}  result")
    with tempfile.TemporaryDirectory() as folder:
        for capture in make_captures(Path(folder), options.seconds, options.seed):
            end = next(line for line in capture.expected if line.startswith("end "))
            frames, lost = _pick([end], "frames")[0], _pick([end], "lost")[0]
            missing = sum(int(_pick([line], "missing")[0]) for line in capture.expected if line.startswith("board "))
            for name in list(clients):
                try:
                    found, expected = clients[name](capture)
                except ProgramMissingError as error:
                    print(f"{name} is left out: {error}")
                    del clients[name]
                    continue
                is_equal = found == expected
                status |= not is_equal
                result = "equal" if is_equal else "DIFFERENT"
                print(f"{capture.name:<18}{name:<8}{frames:>8}{lost:>8}{missing:>9}  {result}", flush=True)
    return status


if __name__ == "__main__":
    sys.exit(main())
