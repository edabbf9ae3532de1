"""Damage an original hub's stream: undamaged messages that are decoded, and damaged messages that pass unnoticed.

python tools/original/damage_rate.py                     three seeds, 20,000 poll cycles of 15 boards each
python tools/original/damage_rate.py --share 0.001       share of the bytes that are damaged (default: 0.01)

A damaged byte is changed to another value, dropped, or preceded by an inserted byte, with equal probability. A message
is undamaged if its bytes are contiguous in the stream. A damaged message is undetected if the decoder accepts a message
with its address byte and other content. The prediction is the formula of protocol/SPEC.md, part 7, for each board.
Exit status 1 if an undamaged message is missing or the predicted number is outside of the 99.9 % interval.
"""

import argparse
import math
import sys
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taxel.stream.original import NativeOriginalDecoder
from taxel_protocol.original import FORMATS, PUBLISHED, READ_SEQUENCE

ORIGINAL = FORMATS["original"]
ORDER = tuple(address for address in READ_SEQUENCE if address in PUBLISHED)
BYTES_PER_S = 11_520
Z = 3.29
"""Standard normal quantile of the two-sided 99.9 % interval."""
PIECE = 4096
FINAL_SHIFTS = 8
"""Largest net number of inserted or lost bytes whose chance end bytes are counted."""


@dataclass(frozen=True)
class Sent:
    """Sent messages: their bytes, and the position of each message in the stream (one more at the end)."""

    stream: NDArray[np.uint8]
    starts: NDArray[np.int64]


def synthesise(cycles: int, rng: np.random.Generator) -> Sent:
    """Create a stream of poll cycles of the 15 boards.

    Counts are near 1,600 with noise and contacts; times are those of a UART at 115,200 baud.
    """
    wires: list[bytes] = []
    starts = [0]
    means = {address: rng.normal(1600, 120, ORIGINAL.taxels[address]) for address in ORDER}
    for _ in range(cycles):
        for address in ORDER:
            taxels = ORIGINAL.taxels[address]
            signal = rng.uniform(0, 900, taxels) * (rng.random(taxels) < 0.1)
            counts = np.clip(means[address] + rng.normal(0, 4, taxels) - signal, 0, 4000).astype("<u2")
            time_ms = 120_000 + starts[-1] * 1000 // BYTES_PER_S
            head = bytes([1, ORIGINAL.lengths[address], address]) + time_ms.to_bytes(4, "big")
            wires.append(head + counts.tobytes() + b"\x0a")
            starts.append(starts[-1] + len(wires[-1]))
    return Sent(np.frombuffer(b"".join(wires), np.uint8), np.array(starts))


def damage(sent: Sent, share: float, rng: np.random.Generator) -> tuple[NDArray[np.uint8], NDArray[np.int64]]:
    """Damage a share of the stream's bytes: change or lose a byte, or insert one before it.

    Returns the received bytes, and for each of them its position in the sent stream; -1 for an inserted byte, and -2 -
    position for a changed byte.
    """
    size = len(sent.stream)
    kind = np.where(rng.random(size) < share, rng.integers(0, 3, size), -1)
    copies = np.ones(size, np.int64)
    copies[kind == 1] = 0
    copies[kind == 2] = 2
    source = np.repeat(np.arange(size), copies)
    received = sent.stream[source].copy()
    is_inserted = np.zeros(len(source), bool)
    is_inserted[:-1] = source[1:] == source[:-1]
    is_changed = kind[source] == 0
    received[is_inserted] = rng.integers(0, 256, int(is_inserted.sum()), dtype=np.uint8)
    received[is_changed] += rng.integers(1, 256, int(is_changed.sum()), dtype=np.uint8)
    places = np.where(is_inserted, -1, np.where(is_changed, -2 - source, source))
    return received, places


def compute_shifts(count: int, share: float) -> NDArray[np.float64]:
    """Compute the probability of each net number of lost bytes among `count` bytes, from -count to count: f64[2 count +
    1].

    share: share of damaged bytes.
    """
    third = share / 3
    one = np.array([third, 1 - share + third, third])  # inserted, kept or changed, lost
    power, result = one, np.ones(1)
    while count:  # convolution power of `one` by repeated squaring
        if count & 1:
            result = np.convolve(result, power)
        power, count = np.convolve(power, power), count >> 1
    return result


def predict_undetected(length: int, share: float) -> float:
    """Return the probability that a message of `length` bytes is damaged but accepted (SPEC.md, part 7).

    Its end byte is then at the right place because the numbers of inserted and dropped bytes are equal.
    """
    kept, inserted = 1 - share, share / 3
    inner = length - 4
    shifts = compute_shifts(inner, share)
    # The start byte (also behind an inserted byte), the length and the address arrive. The end byte is at its place:
    # no net shift of the bytes between them, or one lost byte and one inserted before the end byte.
    aligned = kept * shifts[inner] + inserted * shifts[inner + 1]
    return float((kept + inserted) * kept**2 * (aligned - kept ** (inner + 1)))


def predict_chance_end(length: int, share: float, end_shares: NDArray[np.float64]) -> float:
    """Return the probability that a message with inserted bytes is accepted because a count equals the end byte.

    end_shares: share of end values among the bytes 1, 2, ... before the last byte of this board's messages.
    """
    kept, inserted = 1 - share, share / 3
    total = 0.0
    for excess, end_share in enumerate(end_shares, start=1):  # net number of inserted bytes before the end value
        count = length - 3 - excess
        total += compute_shifts(count, share)[count - excess] * end_share
    return (kept + inserted) * kept**2 * total


def measure(cycles: int, share: float, seed: int) -> tuple[int, int, int, int, float]:
    """Damage a stream, decode it and count its messages.

    cycles: poll cycles of the stream, with one message of each board. share: share of damaged bytes. Returns the
    numbers of sent messages, undamaged messages, undamaged messages that were decoded, and undetected damaged messages,
    and the predicted number of undetected damaged messages.
    """
    rng = np.random.default_rng(seed)
    sent = synthesise(cycles, rng)
    received, places = damage(sent, share, rng)
    data = received.tobytes()
    decoder = NativeOriginalDecoder(ORIGINAL)
    accepted = [m for i in range(0, len(data), PIECE) for m in decoder.push(data[i : i + PIECE])] + decoder.finish()
    accepted_at = {message.position for message in accepted}
    # The received position of each sent byte that arrived unchanged, or -1.
    arrival = np.full(len(sent.stream) + 1, -1, np.int64)
    is_unchanged = places >= 0
    arrival[places[is_unchanged]] = np.nonzero(is_unchanged)[0]
    undamaged = decoded = 0
    lengths = np.diff(sent.starts)
    # Number of unchanged bytes, each directly behind its predecessor in the sent stream, before each received byte.
    good = np.concatenate([[0], np.cumsum(is_unchanged & (np.diff(places, prepend=-9) == 1))])
    for start, length in zip(sent.starts[:-1], lengths, strict=True):
        first, last = arrival[start], arrival[start + length - 1]
        if first >= 0 and last - first == length - 1 and good[last + 1] - good[first + 1] == length - 1:
            undamaged += 1
            decoded += int(first) in accepted_at
    source = np.where(places <= -2, -2 - places, places)  # sent position, also of changed bytes; -1: inserted
    original = sent.stream.tobytes()
    undetected = 0
    for message in accepted:
        length = ORIGINAL.lengths[message.address]
        origin = source[message.position + 2]  # byte 2 is the address
        index = int(np.searchsorted(sent.starts, origin, "right")) - 1 if origin >= 0 else 0
        content = original[sent.starts[index] : sent.starts[index] + length]
        undetected += data[message.position : message.position + length] != content
    predicted = 0.0
    for number, address in enumerate(ORDER):
        length = ORIGINAL.lengths[address]
        ends = sent.starts[number + 1 :: len(ORDER)]
        end_shares = np.array([(sent.stream[ends - 1 - k] == 0x0A).mean() for k in range(1, FINAL_SHIFTS + 1)])
        predicted += cycles * (predict_undetected(length, share) + predict_chance_end(length, share, end_shares))
    return cycles * len(ORDER), undamaged, decoded, undetected, predicted


def main() -> int:
    """Measure and print one line for each seed; the exit status is 1 if a message is missing or the prediction is
    wrong.
    """
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cycles", type=int, default=20_000, help="poll cycles of 15 messages (default: 20000)")
    parser.add_argument("--share", type=float, default=0.01, help="share of damaged bytes (default: 0.01)")
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2, 3], help="random seeds (default: 1 2 3)")
    arguments = parser.parse_args()
    print("seed  messages  undamaged   decoded  undetected  predicted  99.9 % interval of the measured number")
    status = 0
    for seed in arguments.seeds:
        messages, undamaged, decoded, undetected, predicted = measure(arguments.cycles, arguments.share, seed)
        half = Z * math.sqrt(max(undetected, 1) * (1 - undetected / messages))
        is_expected = decoded == undamaged and abs(undetected - predicted) <= half
        status |= not is_expected
        interval = f"{undetected - half:.0f} to {undetected + half:.0f}"
        print(f"{seed:4d}  {messages:8d}  {undamaged:9d}  {decoded:8d}  {undetected:10d}  {predicted:9.1f}  {interval}")
    return status


if __name__ == "__main__":
    sys.exit(main())
