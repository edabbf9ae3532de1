"""Work shared with forked worker processes: equal, ordered results, also if a worker process fails."""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
import threading
import time
from contextlib import suppress
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from taxel.gap.effects.catalogue import OWN_EFFECTS
from taxel.gap.effects.effect import Prior
from taxel.gap.fitting import forked_workers, parallel
from taxel.gap.fitting.parallel import MIN_PARALLEL_VALUES, map_in_processes, map_in_threads

ITEMS = list(range(23))


@pytest.fixture(autouse=True)
def two_cores(monkeypatch):
    """The tests do not depend on the number of cores of the machine."""
    monkeypatch.setattr(parallel, "count_processes", lambda: 2)


@pytest.fixture
def state():
    """Substitute for a state that is just large enough for work in several processes."""
    return SimpleNamespace(
        signal_counts=np.zeros(MIN_PARALLEL_VALUES), coarse=SimpleNamespace(signal_counts=np.zeros(3))
    )


def square(item):
    time.sleep(0.002)
    return item, np.full(item, float(item)) ** 2


def are_results_expected(found):
    """Return whether `found` contains the result of `square` for every item, in the order of the items."""
    return [item for item, _ in found] == ITEMS and all((result == square(item)[1]).all() for item, result in found)


@pytest.mark.parametrize("share", [map_in_processes, map_in_threads])
def test_results_of_shared_work_are_in_order(state, share):
    assert are_results_expected(share(state, square, ITEMS))


def test_work_is_shared_by_two_processes(state):
    assert len(set(map_in_processes(state, lambda item: (time.sleep(0.02), os.getpid())[1], ITEMS))) == 2


@pytest.mark.parametrize("cores", [1, 2, 3])
def test_work_is_shared_by_one_process_for_each_core(state, monkeypatch, cores):
    monkeypatch.setattr(parallel, "count_processes", lambda: cores)
    results = map_in_processes(state, lambda item: (time.sleep(0.05), os.getpid(), square(item)), ITEMS)
    assert len({process for _, process, _ in results}) == cores
    assert are_results_expected([result for _, _, result in results])


def test_at_most_one_process_for_each_item_is_started(state, monkeypatch):
    monkeypatch.setattr(parallel, "count_processes", lambda: 7)
    results = map_in_processes(state, lambda item: (time.sleep(0.02), os.getpid()), [0, 1, 2])
    assert len({process for _, process in results}) <= 3


def test_the_number_of_processes_is_the_number_of_usable_cores(monkeypatch):
    monkeypatch.undo()
    for cores, processes in ((1, 1), (4, 4), (96, parallel.MAX_PROCESSES)):
        monkeypatch.setattr(os, "sched_getaffinity", lambda _, cores=cores: set(range(cores)), raising=False)
        assert parallel.count_processes() == processes


def test_expensive_items_are_processed_first(state, tmp_path):
    def note_start(item):
        with (tmp_path / "order").open("a") as file:  # one short write: the lines of both processes do not mix
            file.write(f"{item}\n")
        time.sleep(0.01)
        return item

    assert map_in_processes(state, note_start, ITEMS, costs=[item % 5 for item in ITEMS]) == ITEMS
    started = [int(line) for line in (tmp_path / "order").read_text().split()]
    # Two processes take the items in order, but one may write before the other.
    assert all(abs(started.index(item) - sorted(ITEMS, key=lambda i: -(i % 5)).index(item)) <= 2 for item in ITEMS)


def test_the_remaining_processes_do_the_work_if_not_all_can_be_forked(state, monkeypatch):
    fork, forked = os.fork, []

    def fork_once():
        if forked:
            raise BlockingIOError("no more processes")
        forked.append(True)
        return fork()

    monkeypatch.setattr(parallel, "count_processes", lambda: 4)
    monkeypatch.setattr(os, "fork", fork_once)
    assert are_results_expected(map_in_processes(state, square, ITEMS))


def test_nested_work_runs_in_the_calling_process(state):
    """The outer work already uses both processes. After the outer work, new work is shared by two processes again."""
    inner = map_in_processes(state, lambda item: len(set(map_in_processes(state, lambda _: os.getpid(), ITEMS))), ITEMS)
    assert set(inner) == {1}
    assert len(set(map_in_processes(state, lambda item: (time.sleep(0.02), os.getpid())[1], ITEMS))) == 2


def test_a_process_that_shares_the_cores_does_all_work_itself(state, monkeypatch):
    monkeypatch.setattr(parallel._Distribution, "is_active", False)  # restored after the test
    parallel.use_one_process()
    for share in (map_in_processes, map_in_threads):
        found = share(state, lambda item: (time.sleep(0.005), os.getpid(), threading.get_ident()), ITEMS)
        assert {one[1:] for one in found} == {(os.getpid(), threading.get_ident())}


def get_distribution(_):
    """Return whether this process does all work itself."""
    return parallel._Distribution.is_active


@pytest.mark.parametrize(("jobs", "diagnoses", "is_alone"), [(2, 5, True), (2, 1, False), (1, 5, False)])
def test_diagnoses_of_a_pool_use_one_core_each(jobs, diagnoses, is_alone):
    """A single process, or the process of a single diagnosis, uses all cores."""
    with parallel.open_diagnosis_pool(jobs, diagnoses) as pool:
        assert set(pool.map(get_distribution, range(diagnoses))) == {is_alone}


def test_work_on_small_data_runs_in_the_calling_process(state):
    state.signal_counts = np.zeros(10)
    assert set(map_in_processes(state, lambda item: os.getpid(), ITEMS)) == {os.getpid()}


def test_results_that_cannot_be_pickled_are_computed_in_the_calling_process(state):
    def return_function(item):
        time.sleep(0.005)
        return lambda: item  # a local function cannot be pickled

    assert [one() for one in map_in_processes(state, return_function, ITEMS)] == ITEMS


def test_an_error_in_either_process_is_raised_in_the_calling_process(state):
    def fail_at_seven(item):
        time.sleep(0.005)
        if item == 7:
            raise ValueError("seven")
        return item

    with pytest.raises(ValueError, match="seven"):
        map_in_processes(state, fail_at_seven, ITEMS)


def test_work_of_a_killed_process_is_repeated(state):
    here = os.getpid()

    def exit_in_worker(item):
        time.sleep(0.005)
        if os.getpid() != here and item > 4:
            os._exit(1)
        return item, np.full(item, float(item)) ** 2

    assert are_results_expected(map_in_processes(state, exit_in_worker, ITEMS))


def test_partially_received_results_of_a_killed_process_are_recomputed(state, monkeypatch):
    here, real = os.getpid(), forked_workers._HEADER

    # The worker process exits before it sends the result of an item above 9.
    class FailingHeader:
        size = real.size
        unpack = staticmethod(real.unpack)

        def pack(self, number, size):
            if number > 9 and os.getpid() != here:
                os._exit(1)
            return real.pack(number, size)

    monkeypatch.setattr(forked_workers, "_HEADER", FailingHeader())
    big = map_in_processes(state, lambda item: (time.sleep(0.005), np.full(50_000, item))[1], ITEMS)
    assert [int(one[0]) for one in big] == ITEMS


def is_ended(pid):
    """True if a process has ended or is a zombie."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] == "Z"
    except OSError:
        return True


def test_a_worker_process_ends_with_its_parent(tmp_path):
    program = f"""
import os, time
from types import SimpleNamespace
import numpy as np
from taxel.gap.fitting import parallel
from taxel.gap.fitting.parallel import MIN_PARALLEL_VALUES, map_in_processes
parallel.count_processes = lambda: 2
here = os.getpid()
def work(item):
    if os.getpid() != here:
        open({str(tmp_path / "copy")!r}, "w").write(str(os.getpid()) + "\\n")
    time.sleep(0.05)
    return bytes(1_000_000)
map_in_processes(SimpleNamespace(signal_counts=np.zeros(MIN_PARALLEL_VALUES)), work, range(200))
"""
    parent = subprocess.Popen([sys.executable, "-c", program])
    deadline = time.monotonic() + 60
    while not ((tmp_path / "copy").exists() and (tmp_path / "copy").read_text().endswith("\n")):
        assert time.monotonic() < deadline
        time.sleep(0.01)
    parent.kill()
    parent.wait()
    worker = int((tmp_path / "copy").read_text())
    while not is_ended(worker):
        assert time.monotonic() < deadline
        time.sleep(0.01)


FORMS = [form for forms in OWN_EFFECTS.values() for form in forms]


@pytest.mark.parametrize("form", FORMS, ids=lambda form: f"{form.name} {form.variant} {form.scope}")
def test_an_effect_with_a_prior_can_be_pickled(form):
    name = form.own_parameters()[0].name
    again = pickle.loads(pickle.dumps(form.with_priors({name: Prior(0.1, 0.2)})))
    assert again.parameters() == form.with_priors({name: Prior(0.1, 0.2)}).parameters()


def test_threads_are_used_if_no_process_can_be_forked(state, monkeypatch):
    def refuse_fork():
        raise PermissionError("no process")

    monkeypatch.setattr(os, "fork", refuse_fork)
    assert are_results_expected(map_in_processes(state, square, ITEMS))


def test_shared_work_leaves_no_open_files_and_no_processes(state):
    def count_open_files():
        return len(os.listdir("/proc/self/fd"))

    def list_children():
        found = []
        for path in Path("/proc").glob("[0-9]*/stat"):
            with suppress(OSError):  # a process of another program has ended
                line = path.read_text()
                found += [line.split()[0]] if line.rsplit(")", 1)[1].split()[1] == str(os.getpid()) else []
        return sorted(found)

    before = count_open_files(), list_children()
    for _ in range(5):
        map_in_processes(state, square, ITEMS)
    assert (count_open_files(), list_children()) == before
