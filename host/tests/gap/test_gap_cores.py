"""Work that is shared with a copy of this process: the same results, in order, whatever happens to the copy."""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from taxel.gap.effects.catalogue import OWN_EFFECTS
from taxel.gap.effects.effect import Prior
from taxel.gap.fitting import cores
from taxel.gap.fitting.cores import WORTH, in_copies, in_threads

ITEMS = list(range(23))


@pytest.fixture
def state():
    return SimpleNamespace(signal_counts=np.zeros(WORTH), coarse=SimpleNamespace(signal_counts=np.zeros(3)))


def square(item):
    time.sleep(0.002)
    return item, np.full(item, float(item)) ** 2


def same(found):
    return [number for number, _ in found] == ITEMS and all((own == square(n)[1]).all() for n, own in found)


@pytest.mark.parametrize("share", [in_copies, in_threads])
def test_results_of_shared_work_are_in_order(state, share):
    assert same(share(state, square, ITEMS))


def test_both_processes_take_part(state):
    assert len(set(in_copies(state, lambda item: (time.sleep(0.02), os.getpid())[1], ITEMS))) == 2


def test_nested_work_runs_in_the_calling_process(state):
    """Both cores are busy then; afterwards the next one is shared again."""
    inner = in_copies(state, lambda item: len(set(in_copies(state, lambda _: os.getpid(), ITEMS))), ITEMS)
    assert set(inner) == {1}
    assert len(set(in_copies(state, lambda item: (time.sleep(0.02), os.getpid())[1], ITEMS))) == 2


def test_small_work_runs_in_the_calling_process(state):
    state.signal_counts = np.zeros(10)
    assert set(in_copies(state, lambda item: os.getpid(), ITEMS)) == {os.getpid()}


def test_results_that_cannot_be_pickled_are_computed_in_the_calling_process(state):
    def local(item):
        time.sleep(0.005)
        return lambda: item  # nothing that could be sent

    assert [one() for one in in_copies(state, local, ITEMS)] == ITEMS


def test_an_error_in_either_process_is_raised_in_the_calling_process(state):
    def fails_late(item):
        time.sleep(0.005)
        if item == 7:
            raise ValueError("seven")
        return item

    with pytest.raises(ValueError, match="seven"):
        in_copies(state, fails_late, ITEMS)


def test_work_of_a_killed_process_is_repeated(state):
    here = os.getpid()

    def kills(item):
        time.sleep(0.005)
        if os.getpid() != here and item > 4:
            os._exit(1)
        return item, np.full(item, float(item)) ** 2

    assert same(in_copies(state, kills, ITEMS))


def test_partially_received_results_of_a_killed_process_are_recomputed(state, monkeypatch):
    here, real = os.getpid(), cores._HEAD

    class Cut:
        size = real.size
        unpack = staticmethod(real.unpack)

        def pack(self, number, size):
            if number > 9 and os.getpid() != here:
                os._exit(1)
            return real.pack(number, size)

    monkeypatch.setattr(cores, "_HEAD", Cut())
    big = in_copies(state, lambda item: (time.sleep(0.005), np.full(50_000, item))[1], ITEMS)
    assert [int(one[0]) for one in big] == ITEMS


def gone(pid):
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] == "Z"
    except OSError:
        return True


def test_a_worker_process_ends_with_its_parent(tmp_path):
    program = f"""
import os, time
from types import SimpleNamespace
import numpy as np
from taxel.gap.fitting.cores import WORTH, in_copies
here = os.getpid()
def work(item):
    if os.getpid() != here:
        open({str(tmp_path / "copy")!r}, "w").write(str(os.getpid()) + "\\n")
    time.sleep(0.05)
    return bytes(1_000_000)
in_copies(SimpleNamespace(drop=np.zeros(WORTH), coarse=SimpleNamespace(drop=0)), work, range(200))
"""
    maker = subprocess.Popen([sys.executable, "-c", program])
    deadline = time.monotonic() + 60
    while not ((tmp_path / "copy").exists() and (tmp_path / "copy").read_text().endswith("\n")):
        assert time.monotonic() < deadline
        time.sleep(0.01)
    maker.kill()
    maker.wait()
    copy = int((tmp_path / "copy").read_text())
    while not gone(copy):
        assert time.monotonic() < deadline
        time.sleep(0.01)


FORMS = [form for forms in OWN_EFFECTS.values() for form in forms]


@pytest.mark.parametrize("form", FORMS, ids=lambda form: f"{form.name} {form.variant} {form.scope}")
def test_an_effect_with_a_prior_can_be_pickled(form):
    name = form.own_parameters()[0].name
    again = pickle.loads(pickle.dumps(form.with_priors({name: Prior(0.1, 0.2)})))
    assert again.parameters() == form.with_priors({name: Prior(0.1, 0.2)}).parameters()


def test_threads_are_used_if_no_process_can_be_forked(state, monkeypatch):
    def refused():
        raise PermissionError("no process")

    monkeypatch.setattr(os, "fork", refused)
    assert same(in_copies(state, square, ITEMS))


def test_shared_work_leaves_no_open_files_and_no_processes(state):
    def open_files():
        return len(os.listdir("/proc/self/fd"))

    def children():
        found = []
        for path in Path("/proc").glob("[0-9]*/stat"):
            with suppress(OSError):  # somebody else's has ended meanwhile
                line = path.read_text()
                found += [line.split()[0]] if line.rsplit(")", 1)[1].split()[1] == str(os.getpid()) else []
        return sorted(found)

    before = open_files(), children()
    for _ in range(5):
        in_copies(state, square, ITEMS)
    assert (open_files(), children()) == before
