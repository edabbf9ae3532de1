"""The clients in C++, Rust and Lua decode every golden vector as the Python decoder does."""

import subprocess
import sys
from pathlib import Path

import pytest

from host.tests.clients.conftest import fuzzed_streams, programs, reference, run_client

ROOT = Path(__file__).resolve().parents[3]


def test_generated_files_of_the_clients_are_not_stale():
    script = ROOT / "tools" / "codegen" / "clients.py"
    result = subprocess.run([sys.executable, str(script), "--check"], capture_output=True, text=True, timeout=60)
    assert result.returncode == 0, result.stderr


@pytest.fixture(scope="module")
def streams():
    """Every golden vector that is a frame or a stream."""
    return list(reference.list_streams())


@pytest.fixture(scope="module")
def expected(streams):
    """The lines of each stream by the Python decoder."""
    return [reference.format_stream(stream, has_wire=True) for stream in streams]


def without_wire(line):
    """Return a line without the re-encoded frame, which a client without encoder does not print."""
    return line.partition(" wire=")[0]


@pytest.mark.parametrize("language", programs.LANGUAGES)
def test_every_frame_and_stream_is_decoded_and_encoded(language, streams, expected):
    has_encoder = language != "lua"  # without an encoder, the lines lack the re-encoded frame (" wire=")
    lines = iter(run_client(language, "vectors", text=reference.format_requests(streams, [])))
    for stream, wanted in zip(streams, expected, strict=True):
        found = [next(lines) for _ in wanted]
        assert found == (wanted if has_encoder else list(map(without_wire, wanted))), stream.name
    assert next(lines, None) is None


@pytest.mark.parametrize("language", programs.LANGUAGES)
def test_every_register_is_decoded(language):
    registers = reference.list_registers()
    lines = run_client(language, "vectors", text=reference.format_requests([], registers))
    assert lines == [reference.format_register(vector) for vector in registers]


@pytest.mark.parametrize("language", programs.LANGUAGES)
def test_every_message_and_stream_of_the_original_hub_is_decoded(language):
    vectors = reference.list_originals()
    lines = iter(run_client(language, "vectors", text=reference.format_requests([], originals=vectors)))
    for vector in vectors:
        expected = reference.format_original(vector)
        assert [next(lines) for _ in expected] == expected, vector["name"]
    assert next(lines, None) is None


@pytest.mark.parametrize("language", programs.LANGUAGES)
def test_arbitrary_streams_give_the_result_of_the_python_decoder(language):
    streams = [fuzzed_streams.make_random_stream(seed) for seed in range(40)]
    streams += [fuzzed_streams.make_compact_stream(seed) for seed in range(60)]
    lines = iter(run_client(language, "vectors", text=reference.format_requests(streams, [])))
    for stream in streams:
        expected = list(map(without_wire, reference.format_stream(stream, has_wire=False)))
        assert [without_wire(next(lines)) for _ in expected] == expected, stream.name
    assert next(lines, None) is None
