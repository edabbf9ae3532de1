"""Every reader refuses mutated and special files with one line; the fuzzing itself detects planted errors."""

import os
import signal
from random import Random

import numpy as np
import pytest

from taxel.errors import TaxelError

SEED = 20260131
COUNT = 10_000
"""Mutated files of the short run; `make fuzz-files` reads a million."""

LIMIT_S = 20
SLOW = {"report-page", "gazebo", "active", "emulator"}
"""Readers that take more than 20 ms for one file: 20 files of each are read."""


def share_inputs():
    """Number of inputs of each reader in the short run: the cheap readers get most of them."""
    from fuzz_files.registry import list_targets

    targets = list_targets()
    weights = {name: 0.0 if name in SLOW else target.weight for name, target in targets.items()}
    return targets, {
        name: 20 + round((COUNT - 20 * len(targets)) * weights[name] / sum(weights.values())) for name in targets
    }


@pytest.fixture(scope="module")
def targets():
    return share_inputs()


@pytest.mark.parametrize(
    "family", ["recordings", "descriptions", "firmware", "geometry", "datasets", "imports", "stored", "emulator"]
)
def test_mutated_files_give_an_error_line_or_the_data_of_the_file(targets, tmp_path, family):
    from fuzz_files.judgement import FINDING, MutantReader

    by_name, shares = targets
    print(f"seed {SEED}")
    findings = []
    for name, target in by_name.items():
        if target.make.__module__.rpartition(".")[2] not in (family, f"targets.{family}"):
            continue
        folder = tmp_path / name
        folder.mkdir()
        reader = MutantReader(target, folder)
        for number in range(shares[name]):
            outcome = reader.judge(reader.maker.make(SEED, number))
            if outcome.kind == FINDING:
                findings.append(f"--reader {name} --seed {SEED} --number {number}: {outcome.text}")
    assert findings == []


class WaitingError(BaseException):
    """The reader waits; no reader catches this error."""


def stop_waiting(number, frame):
    raise WaitingError


@pytest.mark.parametrize("kind", ["pipe", "endless device"])
def test_every_reader_refuses_a_pipe_and_an_endless_device(targets, tmp_path, kind):
    from fuzz_files.judgement import read_files

    previous = signal.signal(signal.SIGALRM, stop_waiting)
    accepted = []
    try:
        for name, target in targets[0].items():
            if name == "emulator":  # a program of its own; its inputs are tested in host/tests/link
                continue
            folder = tmp_path / name
            folder.mkdir()
            path = folder / target.make(folder)
            for file in sorted(read_files(folder)):
                place = folder / file
                content = place.read_bytes()
                place.unlink()
                if kind == "pipe":
                    os.mkfifo(place)
                else:
                    place.symlink_to("/dev/zero")
                signal.alarm(LIMIT_S)
                try:
                    target.read(path)
                    accepted.append(f"{name} {file}")
                except target.errors:
                    pass
                finally:
                    signal.alarm(0)
                place.unlink()
                place.write_bytes(content)
    finally:
        signal.signal(signal.SIGALRM, previous)
    # The folder of a recording in CSV may lack the contact points, which only other programs read.
    assert accepted == ["csv a.csv/active.csv"]


def make_reader(tmp_path, read, **rules):
    """MutantReader of a reader of one JSON object with the fields a (a number) and b (a text)."""
    from fuzz_files.judgement import MutantReader
    from fuzz_files.target import Rules, Target
    from fuzz_files.text_codecs import Json

    def make(folder):
        (folder / "a.json").write_text('{"a": 5, "b": "text"}')
        return "a.json"

    return MutantReader(Target("planted", make, ((r"\.json$", (Json(),)),), read, rules=Rules(**rules)), tmp_path)


def list_findings(reader, count=300):
    """Texts of the findings among the first inputs."""
    outcomes = [reader.judge(reader.maker.make(1, number)) for number in range(count)]
    return [outcome.text for outcome in outcomes if outcome.kind == "finding"]


class PlantedError(TaxelError):
    """An error of a reader of this file."""


def read_strictly(path):
    from fuzz_files.text_codecs import Json

    try:
        document = Json().decode(path.read_bytes())
        if set(document) != {"a", "b"} or type(document["a"]) is not int or type(document["b"]) is not str:
            raise PlantedError("a.json: expected a and b")
    except (ValueError, RecursionError, TypeError):
        raise PlantedError("a.json: expected JSON") from None
    return dict(document)


def test_a_correct_reader_has_no_finding(tmp_path):
    assert list_findings(make_reader(tmp_path, read_strictly)) == []


@pytest.mark.parametrize(
    ("change", "text"),
    [
        (lambda data: data | {"a": min(data["a"], 100)}, "is not in the data"),
        (lambda data: {"a": data["a"], "b": "text"}, "have no effect"),
        (lambda data: {"a": data["a"], "b": bytes([data["a"]])}, "ValueError"),
        (lambda data: data | {"c": np.float64(data["a"]) * 1e308}, "warning of a computation"),
    ],
)
def test_a_planted_error_of_a_reader_is_found(tmp_path, change, text):
    findings = list_findings(make_reader(tmp_path, lambda path: change(read_strictly(path))))
    assert any(text in finding for finding in findings), findings[:3]


def test_a_difference_without_a_changed_field_is_found(tmp_path):
    """The data of this reader depend on the number of the read, not only on the file: `n` changes at the third read."""
    numbers = iter(range(10**6))

    def read(path):
        data = read_strictly(path)
        return data | {"n": 0 if next(numbers) < 2 else 1}

    assert any("no field of the file differs" in finding for finding in list_findings(make_reader(tmp_path, read)))


def test_equal_numbers_give_equal_mutants(targets, tmp_path):
    from fuzz_files.judgement import read_files
    from fuzz_files.mutant import MutantMaker

    target = targets[0]["bench-plan"]
    target.make(tmp_path)
    makers = [MutantMaker(target, read_files(tmp_path)) for _ in range(2)]
    mutants = [[maker.make(3, number) for number in range(50)] for maker in makers]
    assert mutants[0] == mutants[1]
    assert len({mutant.files["a.toml"] for mutant in mutants[0]}) > 40


def test_bytes_of_every_operation_differ():
    """Every mutation of bytes changes the bytes with at least one of 20 seeds."""
    from fuzz_files.byte_mutation import OPERATIONS

    for operation in OPERATIONS:
        changed = [operation(bytes(range(256)) * 4, Random(number)) for number in range(20)]
        assert any(each != bytes(range(256)) * 4 for each in changed), operation.__name__


def test_elements_that_only_move_in_a_sorted_list_are_no_finding():
    from fuzz_files.document import flatten
    from fuzz_files.mutant import find_moved
    from fuzz_files.oracle import Change, find_silent_error
    from fuzz_files.target import Rules

    before = flatten({"boards": [{"name": "dome", "x": 0.0}, {"name": "slab", "x": 1.0}]})
    after = flatten({"boards": [{"name": "slab", "x": 1.0}, {"name": "dome", "x": 7.0}]})
    paths = ["boards[0].name", "boards[0].x", "boards[1].name", "boards[1].x"]
    moved = find_moved(before, after, paths)
    assert moved == {"boards[0].name", "boards[0].x", "boards[1].name"}
    read = flatten({"boards": [{"name": "dome", "x": 7.0}, {"name": "slab", "x": 1.0}]})  # the reader sorts by name
    assert not find_silent_error(Rules(), before, read, Change(after, tuple(paths), moved=moved))
    assert "'slab' of the file is not in the data" in find_silent_error(
        Rules(), before, read, Change(after, tuple(paths))
    )
