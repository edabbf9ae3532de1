"""Options of the campaigns that compare decoders on numbered random streams, and their blocks for processes."""

import argparse

BLOCK = 2_000
"""Streams that one process checks before it reports."""


def parse_options(description: str, streams: int) -> argparse.Namespace:
    """Parse the options of a campaign and print its seed. streams: default number of streams."""
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--streams", type=int, default=streams)
    parser.add_argument("--seed", type=int, default=1, help="random seed (default: 1)")
    parser.add_argument("--first", type=int, default=0, help="number of the first stream")
    parser.add_argument("--jobs", type=int, default=1, help="processes (default: 1)")
    options = parser.parse_args()
    print(f"seed {options.seed}")
    return options


def list_ranges(options: argparse.Namespace) -> list[tuple[int, int, int]]:
    """Divide the streams into blocks and return (seed, number of the first stream, number of streams) of each."""
    end = options.first + options.streams
    return [(options.seed, i, min(BLOCK, end - i)) for i in range(options.first, end, BLOCK)]


def print_difference(difference: str, seed: int) -> None:
    """Print a difference such as "stream 77: messages differs", and the options that repeat its stream."""
    index = int(difference.split()[1].rstrip(":"))
    print(f"{difference}; replay: --seed {seed} --first {index} --streams 1")
