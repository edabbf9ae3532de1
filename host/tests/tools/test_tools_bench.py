"""tools/bench: the benchmarks that take seconds run to their end; `make bench` compares their figures with limits."""

from pathlib import Path
from typing import Any

import h5py
import pytest


@pytest.mark.slow
@pytest.mark.parametrize("name", ["skin_rate", "compact", "latency", "decoder", "startup"])
def test_a_benchmark_gives_a_ratio_for_each_of_its_figures(import_tool: Any, name: str) -> None:
    figures = import_tool("bench", f"bench_{name}").measure()
    assert figures
    assert [figure.name for figure in figures if figure.ratio is None or not figure.ratio > 0.0] == []


def test_the_reference_of_the_dataset_benchmark_reads_all_arrays(
    import_tool: Any, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """A visitor of h5py that returns a value would end the reading with the first array."""
    path, reads = tmp_path / "two.h5", []
    with h5py.File(path, "w") as file:
        file["first"], file["second"] = [1.0], [2.0]
    read_value = h5py.Dataset.__getitem__
    monkeypatch.setattr(
        h5py.Dataset, "__getitem__", lambda item, key: (reads.append(item.name), read_value(item, key))[1]
    )
    import_tool("bench", "bench_recording")._read_with_h5py(path)
    assert reads == ["/first", "/second"]


def test_compact_frames_of_the_original_hand_are_decoded_and_take_little_more_than_their_entropy(
    import_tool: Any,
) -> None:
    """A poll before the end of a scan gives no frame, so that not every poll cycle has a frame of every board."""
    bench, noise_counts, seconds = import_tool("bench", "bench_compact"), 4.0, 0.5
    hand = bench.load_hand("original")
    tally = bench.measure_bytes(hand, noise_counts, seconds, has_contacts=False)
    assert len(tally.counts) > 0.5 * tally.cycles > 0
    bits_per_taxel = 8.0 * (tally.coded + tally.packed) / (tally.cycles * hand.n_taxels)
    assert 1.0 <= bits_per_taxel / bench.compute_noise_entropy(noise_counts) < bench.ENTROPY_RATIO_MAX
