"""Exact numbers of error patterns that CRC-32 does not detect at the lengths of the frames.

python tools/crc/exact.py

A CRC does not detect an error pattern whose polynomial is a multiple of the generator, independent of the data. Shifted
patterns are equivalent, so the program enumerates the patterns that contain bit 0 and counts the positions at which
they fit. It verifies the break points of Koopman, "32-bit cyclic redundancy codes for Internet applications", DSN 2002.
"""

import argparse
import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from taxel.types import WordArray
from taxel_protocol.frames import FRAMES
from taxel_protocol.limits import (
    ADDRESS_MAX,
    ADDRESS_MIN,
    BODY_MAX,
    FRAME_CRC_SIZE,
    FRAME_HEADER_SIZE,
    SNAPSHOT_OVERHEAD,
)
from taxel_protocol.names import FrameType

GENERATOR = 0x04C11DB7
"""Generator polynomial without x^32 (IEEE 802.3, clause 3.2.9)."""

BREAK_POINTS = {9: 67, 8: 90, 7: 124, 6: 204, 5: 301, 4: 3007}
"""Shortest code word in bits with an undetected pattern, by the number of bits of the pattern (Koopman 2002, table 1:
data bits + 32 + 1).
"""

LENGTHS = (11, 15, 16, 25, 26, 37, 38, 75, 153, 252, 375, 376, 507)
"""Lengths of bodies in the table, bytes: the break points, and the shortest, average and longest taxel frame."""

SECONDS_PER_YEAR = 365.25 * 86400

BYTE_RATE = 100_000
"""Bytes per second of a UART at 1 Mbaud with a start and a stop bit."""


def compute_bit_syndromes(count: int) -> WordArray:
    """Compute the CRC syndromes u32[count] of single-bit errors.

    Element i is x^i modulo the generator: the error of the bit i bits before the last one on the wire.
    """
    values = np.empty(count, np.uint32)
    state = 1
    for i in range(count):
        values[i] = state
        # Multiply by x; if the result has the term x^32 (bit 32), subtract the generator.
        state = (state << 1) ^ ((0x100000000 | GENERATOR) if state & 0x80000000 else 0)
    return values


def xor_subsets(syndromes: WordArray, size: int) -> WordArray:
    """Return the XOR of every subset of `size` syndromes, in colexicographic order (sorted by the largest index)."""
    values = syndromes
    for k in range(2, size + 1):
        # The first comb(j, k - 1) values belong to the subsets of k - 1 syndromes with indices below j.
        parts = [values[: math.comb(j, k - 1)] ^ syndromes[j] for j in range(len(syndromes))]
        values = np.concatenate(parts)
    return values


def find_largest_index(order: int, size: int, count: int) -> int:
    """Return the largest index in the subset number `order` of the result of `xor_subsets` over `count` syndromes."""
    return next(j for j in range(count) if math.comb(j + 1, size) > order)


def find_shortest_word(weight: int, bits: int) -> int | None:
    """Return the shortest length in bits at which the CRC misses a pattern of `weight` changed bits.

    bits: largest length that is searched; the result is None if no pattern fits into it. Valid only if no undetected
    pattern of `weight` - 2 bits fits into `bits`: two halves that share a bit would be taken for a pattern.
    """
    syndromes = compute_bit_syndromes(bits)
    # The shortest pattern contains bit 0. The other bits are divided into two halves. A pattern is undetected if the
    # XOR of the syndromes of bit 0 and of the first half equals the XOR of the syndromes of the second half.
    first_size = (weight - 1) // 2
    second_size = weight - 1 - first_size
    first_half = xor_subsets(syndromes[1:], first_size) ^ syndromes[0]
    second_half = xor_subsets(syndromes[1:], second_size)
    common = np.intersect1d(first_half, second_half)
    spans = []
    for value in common:
        for i in np.flatnonzero(first_half == value):
            for j in np.flatnonzero(second_half == value):
                last = max(find_largest_index(int(i), first_size, bits), find_largest_index(int(j), second_size, bits))
                spans.append(last + 2)  # the largest index refers to syndromes[1:], so the largest bit is last + 1
    return min(spans, default=None)


def count_four_bit_spans(bits: int) -> NDArray[np.int64]:
    """Count the four-bit error patterns that the CRC does not detect, by span: i64[bits + 1].

    Element n counts the patterns whose first and last changed bits span exactly n bits, both included.
    """
    syndromes = compute_bit_syndromes(bits)
    order = np.argsort(syndromes)
    sorted_syndromes = syndromes[order]
    spans = np.zeros(bits + 1, np.int64)
    for j in range(2, bits):
        required = syndromes[1:j] ^ syndromes[0] ^ syndromes[j]
        position = np.minimum(np.searchsorted(sorted_syndromes, required), bits - 1)
        fourth_bits = order[position[sorted_syndromes[position] == required]]
        np.add.at(spans, fourth_bits[fourth_bits > j] + 1, 1)
    return spans


def compute_burst_rank() -> int:
    """Compute the rank of 32 neighbouring bit syndromes over GF(2), by Gaussian elimination.

    With rank 32 no XOR of these syndromes is zero, so the CRC detects every burst of up to 32 bits.
    """
    rows = [int(value) for value in compute_bit_syndromes(32)]
    rank = 0
    for bit in reversed(range(32)):
        pivot = next((row for row in rows if row >> bit & 1), None)
        if pivot is not None:
            rows.remove(pivot)
            rows = [row ^ pivot if row >> bit & 1 else row for row in rows]
            rank += 1
    return rank


def compute_byte_syndromes(count: int) -> WordArray:
    """Compute the CRC syndromes u32[count, 256] of single changed bytes.

    Element [d, e] belongs to the error e (XOR of the sent and the received byte) at d bytes before the last byte.
    """
    bits = compute_bit_syndromes(8 * count).reshape(count, 8)
    table = np.zeros((count, 256), np.uint32)
    for bit in range(8):
        columns = np.flatnonzero(np.arange(256) >> bit & 1)
        table[:, columns] ^= bits[:, bit, None]
    return table


def count_byte_pattern_spans(count: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the numbers of undetected patterns of two and of three changed bytes, i64[count + 1] each, by span.

    Element n counts the patterns whose first and last changed bytes span exactly n bytes, both included. The syndrome
    of an error in the last byte of a word is the error byte itself, in the low 8 bits. A pattern is therefore
    undetected if the syndrome of its other bytes is zero in the upper 24 bits and equals the last error byte, which is
    not zero, in the low 8 bits.
    """
    table = compute_byte_syndromes(count)[1:, 1:]
    two_byte_spans = np.zeros(count + 1, np.int64)
    three_byte_spans = np.zeros(count + 1, np.int64)
    positions = np.repeat(np.arange(1, count), 255)
    values = table.reshape(-1)
    np.add.at(two_byte_spans, positions[(values >> 8) == 0] + 1, 1)
    order = np.argsort(values >> 8, kind="stable")
    keys, positions, values = (values >> 8)[order], positions[order], values[order]
    offset = 1  # Equal keys are adjacent after sorting: offsets 1, 2, ... give every pair of equal upper 24 bits.
    while offset < len(keys) and (has_equal_keys := keys[offset:] == keys[:-offset]).any():
        first = np.flatnonzero(has_equal_keys)
        second = first + offset
        is_pattern = (positions[first] != positions[second]) & (values[first] != values[second])
        np.add.at(three_byte_spans, np.maximum(positions[first], positions[second])[is_pattern] + 1, 1)
        offset += 1
    return two_byte_spans, three_byte_spans


def count_placements(spans: NDArray[np.int64], length: int) -> int:
    """Return the number of error patterns in a word of `length` bits or bytes, counted at every position.

    spans: element n is the number of patterns whose first and last errors span n bits or bytes (the unit of `length`).
    Each of these patterns fits into the word at length - n + 1 positions.
    """
    return sum(int(spans[n]) * (length - n + 1) for n in range(1, length + 1))


def compute_block_end_probability(length: int) -> NDArray[np.float64]:
    """Compute the probability that a block of the byte stuffing ends after exactly n bytes of the body:
    f64[length + 1].

    The stuffed bytes are random, uniformly distributed from 1 to 255. A block with the code c contains c - 1 bytes, and
    a zero follows them unless c is 255. starts[n], ends[n]: probability that a block begins, or ends, at byte n.
    """
    starts = np.zeros(length + 256)
    ends = np.zeros(length + 256)
    starts[0] = 1
    for n in range(length + 1):
        ends[n : n + 255] += starts[n] / 255
        starts[n + 1 : n + 255] += starts[n] / 255
        starts[n + 254] += starts[n] / 255
    return ends[: length + 1]


def list_allowed_bodies() -> Iterator[tuple[int, float]]:
    """Yield each permitted length of a frame body sent to the host, in bytes, and the probability that a random header
    is valid and states this length.
    """
    for frame_type, spec in FRAMES.items():
        if frame_type & 0x80:  # a frame to the hub
            continue
        for payload in range(spec.minimum, spec.maximum + 1):
            chance = 2.0**-24  # type (8 bits) and length (16 bits)
            if spec.has_address:
                chance *= (ADDRESS_MAX - ADDRESS_MIN + 1) / 256
            if frame_type == FrameType.TAXELS:
                if (payload - 8 - SNAPSHOT_OVERHEAD) % 2:  # after a header of 8 bytes: counts of 2 bytes each
                    continue
                chance /= 256  # the taxel count must match the length
            yield FRAME_HEADER_SIZE + payload + FRAME_CRC_SIZE, chance


def compute_random_frame_probability() -> float:
    """Compute the probability that a decoder accepts a frame at one position of a stream of random nonzero bytes."""
    ends = compute_block_end_probability(BODY_MAX)
    return float(sum(chance * ends[body] for body, chance in list_allowed_bodies())) * 2.0**-32


def print_break_points() -> None:
    """Print the frame lengths at which the CRC's Hamming distance changes: computed and published values."""
    print("Shortest code word (bits) with an undetected pattern of this number of bits")
    print("  bits   computed  published")
    four = count_four_bit_spans(8 * BODY_MAX)
    for weight, published in BREAK_POINTS.items():
        computed = int(np.flatnonzero(four)[0]) if weight == 4 else find_shortest_word(weight, published + 4)
        print(f"  {weight:4d}  {computed!s:>9}  {published:9d}  {'agrees' if computed == published else 'DIFFERS'}")
    three = find_shortest_word(3, 8 * BODY_MAX)
    print(f"  2 and 3: none up to {8 * BODY_MAX} bits (three: {'none found' if three is None else three})")
    rank = compute_burst_rank()
    print(f"  bursts: rank of 32 neighbouring bits {rank}: every burst of up to {rank} bits is detected\n")


def print_lengths() -> None:
    """Print the CRC's Hamming distance and the number of undetected error patterns for each length of `LENGTHS`."""
    four = count_four_bit_spans(8 * BODY_MAX)
    two_bytes, three_bytes = count_byte_pattern_spans(BODY_MAX)
    print("Undetected patterns by body length (bytes, CRC included)")
    print("  body   HD   4 bits    share of them   2 bytes   3 bytes    share of them")
    for length in LENGTHS:
        bits = 8 * length
        distance = min(weight for weight, shortest in BREAK_POINTS.items() if bits >= shortest)
        in_bits, in_two, in_three = (
            count_placements(four, bits),
            count_placements(two_bytes, length),
            count_placements(three_bytes, length),
        )
        share_bits = in_bits / math.comb(bits, 4)
        share_bytes = in_three / (math.comb(length, 3) * 255**3)
        print(
            f"  {length:4d} {distance:4d} {in_bits:8d}    {share_bits:13.2e}"
            f" {in_two:9d} {in_three:9d}    {share_bytes:13.2e}"
        )
    print(f"  (2^-32 = {2.0**-32:.2e})\n")


def print_rates(frame_rate: float, body: int) -> None:
    """Print how many damaged frames per year a decoder accepts, for several byte error rates.

    frame_rate: frames per second. body: bytes of a frame's body.
    """
    random_frame = compute_random_frame_probability()
    wire = body + body // 254 + 1  # byte stuffing adds a code byte to each block of up to 254 bytes
    print("Random bytes without a zero")
    print(f"  valid header at one position              {sum(chance for _, chance in list_allowed_bodies()):.2e}")
    print(f"  accepted frame at one position            {random_frame:.2e}")
    print(f"  years between accepted frames, at 1 Mbaud   {1 / (random_frame * BYTE_RATE * SECONDS_PER_YEAR):.0f}\n")
    print(f"{frame_rate:.0f} frames per second of {wire} stuffed bytes")
    print("  byte error rate   damaged a year   three or more bytes   accepted a year, at most")
    for rate in (1e-9, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3):
        damaged = -math.expm1(wire * math.log1p(-rate))
        up_to_two = sum(math.comb(wire, k) * rate**k * (1 - rate) ** (wire - k) for k in (1, 2))
        # Rounding can falsify the difference at small rates; exactly three damaged bytes are a lower bound.
        many = max(damaged - up_to_two, math.comb(wire, 3) * rate**3 * (1 - rate) ** (wire - 3))
        yearly = frame_rate * SECONDS_PER_YEAR
        accepted = damaged * (2.0**-32 + wire * random_frame)
        print(f"  {rate:15.0e}   {yearly * damaged:14.3g}   {yearly * many:19.3g}   {yearly * accepted:24.2g}")
    print(
        "  upper bound: every damaged frame counts as a random word; one or two changed data bytes are always detected"
    )


def main() -> None:
    """Print all tables of the errors that the CRC does not detect."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "--frame-rate",
        type=float,
        default=19 * 17,
        help="taxel frames per second (default: 17 boards at 19 Hz)",
    )
    parser.add_argument("--body", type=int, default=153, help="bytes of a body (default: 63 taxels, the average board)")
    arguments = parser.parse_args()
    print_break_points()
    print_lengths()
    print_rates(arguments.frame_rate, arguments.body)


if __name__ == "__main__":
    main()
