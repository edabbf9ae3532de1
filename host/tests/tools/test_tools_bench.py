"""tools/bench: the benchmarks that take seconds run to their end; `make bench` compares their figures with limits."""

import importlib
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

FOLDER = str(Path(__file__).resolve().parents[3] / "tools" / "bench")


@pytest.fixture(autouse=True)
def import_from_the_folder(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Import modules from the folder of the benchmarks; remove them afterwards: their names are common."""
    monkeypatch.syspath_prepend(FOLDER)
    before = set(sys.modules)
    yield
    for name in set(sys.modules) - before:
        if str(getattr(sys.modules[name], "__file__", "")).startswith(str(Path(FOLDER).parent)):
            del sys.modules[name]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["skin_rate", "compact", "latency", "decoder", "startup"])
def test_a_benchmark_gives_a_ratio_for_each_of_its_figures(name: str) -> None:
    figures = importlib.import_module(f"bench_{name}").measure()
    assert figures
    assert [figure.name for figure in figures if figure.ratio is None or not figure.ratio > 0.0] == []


def test_the_reference_of_the_dataset_benchmark_reads_all_arrays(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """A visitor of h5py that returns a value would end the reading with the first array."""
    h5py = pytest.importorskip("h5py")
    path, reads = tmp_path / "two.h5", []
    with h5py.File(path, "w") as file:
        file["first"], file["second"] = [1.0], [2.0]
    read_value = h5py.Dataset.__getitem__
    monkeypatch.setattr(
        h5py.Dataset, "__getitem__", lambda item, key: (reads.append(item.name), read_value(item, key))[1]
    )
    importlib.import_module("bench_recording")._read_with_h5py(path)
    assert reads == ["/first", "/second"]
