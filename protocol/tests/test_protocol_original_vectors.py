"""The vectors of the original hub: construct, the Python decoder and the C decoder give the same messages."""

import ctypes
import importlib
import json
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from taxel.stream.original import NativeOriginalDecoder
from taxel_protocol.original import FORMATS, OriginalMessage, encode_message, parse_message
from taxel_protocol.original_stream import OriginalDecoder

ROOT = Path(__file__).resolve().parents[2]
VECTORS = json.loads((ROOT / "protocol" / "vectors" / "original.json").read_text())
every_message = pytest.mark.parametrize("vector", VECTORS["messages"], ids=lambda vector: vector["name"])
every_stream = pytest.mark.parametrize("vector", VECTORS["streams"], ids=lambda vector: vector["name"])
every_decoder = pytest.mark.parametrize("language", ["Python", "C"])


@pytest.fixture(scope="module")
def campaign() -> Iterator[ModuleType]:
    """Module tools/original/original_campaign.py."""
    folder = str(ROOT / "tools" / "original")
    sys.path.insert(0, folder)
    yield importlib.import_module("original_campaign")
    while folder in sys.path:
        sys.path.remove(folder)


def build_decoder(language: str, vector: dict[str, Any], library: str) -> OriginalDecoder | NativeOriginalDecoder:
    """Build a decoder in the given language for the format of a vector; library: path of the C codec."""
    known = FORMATS[vector["format"]]
    return OriginalDecoder(known) if language == "Python" else NativeOriginalDecoder(known, ctypes.CDLL(library))


def build_expected(vector: dict[str, Any]) -> OriginalMessage:
    """Return the message that the decoders must give for a vector."""
    time_ms = vector["timestamp_ms"] if FORMATS[vector["format"]].has_timestamp else None
    accelerations = tuple((value ^ 0x8000) - 0x8000 for value in vector["accelerations"])
    return OriginalMessage(vector["address"], time_ms, tuple(vector["counts"]), accelerations)


@every_message
def test_construct_builds_and_parses_the_vector(vector: dict[str, Any]) -> None:
    known, message = FORMATS[vector["format"]], build_expected(vector)
    wire = bytes.fromhex(vector["wire"])
    assert parse_message(known, message.address, wire) == message
    time_ms = message.timestamp_ms or 0
    assert encode_message(known, message.address, message.counts, time_ms, message.accelerations) == wire


@every_decoder
@every_message
def test_both_decoders_decode_the_vector(codec_library_path: str, vector: dict[str, Any], language: str) -> None:
    decoder = build_decoder(language, vector, codec_library_path)
    messages = decoder.push(bytes.fromhex(vector["wire"])) + decoder.finish()
    assert [(m.address, m.timestamp_ms, m.counts, m.accelerations) for m in messages] == [
        (m.address, m.timestamp_ms, m.counts, m.accelerations) for m in (build_expected(vector),)
    ]
    assert (decoder.discarded_bytes, decoder.rejected_candidates) == (0, 0)


@every_decoder
@every_stream
@pytest.mark.parametrize("piece", [1, 7, 251, 1 << 20])
def test_both_decoders_decode_the_stream_in_pieces_of_any_size(
    codec_library_path: str, vector: dict[str, Any], language: str, piece: int
) -> None:
    decoder = build_decoder(language, vector, codec_library_path)
    stream = bytes.fromhex(vector["stream"])
    messages = [m for i in range(0, len(stream), piece) for m in decoder.push(stream[i : i + piece])]
    messages += decoder.finish()
    assert [message.position for message in messages] == vector["accepted"]
    assert [message.is_time_plausible for message in messages] == vector["plausible"]
    assert decoder.messages == len(messages)
    for counter in ("discarded_bytes", "rejected_candidates", "ambiguous_candidates"):
        assert getattr(decoder, counter) == vector[counter]
    assert (decoder.position, decoder.pending_bytes) == (len(stream), 0)


@every_stream
def test_every_undamaged_message_of_the_streams_is_accepted(vector: dict[str, Any]) -> None:
    assert set(vector["undamaged"]) <= set(vector["accepted"])


@pytest.mark.parametrize("seed", [1, 2])
def test_both_decoders_and_construct_agree_on_fuzzed_streams(campaign: ModuleType, seed: int) -> None:
    """Short run of tools/original/original_campaign.py, comparing every `ORACLE_EVERY`-th stream with construct."""
    print(f"seed {seed}")
    tally, difference = campaign.check_range(seed, 0, 3000)
    assert difference is None
    assert tally["streams"] == 3000
    assert tally["ambiguous candidates"] > 100
    assert tally["by construct"] == 3000 // campaign.ORACLE_EVERY


def test_a_decoder_that_counts_differently_is_detected(campaign: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(campaign.NativeOriginalDecoder, "discarded_bytes", 0)
    _, difference = campaign.check_range(seed=1, first=0, count=50)
    assert difference is not None
    assert "C decoder" in difference


def test_a_buffer_below_the_smallest_size_is_rejected() -> None:
    with pytest.raises(ValueError, match="expected 512 bytes or more, found 511"):
        NativeOriginalDecoder(capacity=511)


@pytest.mark.parametrize("seed", [1, 2])
def test_undamaged_messages_are_all_decoded_and_undetected_damage_has_the_predicted_rate(
    campaign: ModuleType, seed: int
) -> None:
    """Short run of tools/original/damage_rate.py with 1 % damaged bytes."""
    tool = importlib.import_module("damage_rate")
    messages, undamaged, decoded, undetected, predicted = tool.measure(600, 0.01, seed)
    assert messages == 600 * 15  # poll cycles, boards
    assert decoded == undamaged > 2500
    assert undetected == pytest.approx(predicted, abs=3.9 * predicted**0.5)  # a Poisson count; 1 in 10,000 is outside
