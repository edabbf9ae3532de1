"""Shards on a Dask cluster: the same bytes as on one machine, and one line for what is missing."""

from __future__ import annotations

import copyreg
import sys
from unittest import mock

import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from taxel.generate.cluster import Cluster, check_releases
from taxel.generate.errors import ClusterError
from taxel.generate.one_thread import one_thread
from taxel.generate.run import generate

PICKLED = dict(copyreg.dispatch_table)
distributed = pytest.importorskip("distributed")
copyreg.dispatch_table.clear()  # distributed has every exception of the process pickled with its traceback
copyreg.dispatch_table.update(PICKLED)


@pytest.fixture(scope="module")
def scheduler():
    options = {"host": "127.0.0.1", "protocol": "tcp://", "processes": False, "dashboard_address": None}
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, **options) as local:
        assert local.scheduler_address.startswith("tcp://127.0.0.1:")
        yield local


def test_a_cluster_makes_the_same_bytes(whole, files_of, scheduler, tmp_path):
    out = tmp_path / "cluster"
    assert generate(whole.recipe, out, Cluster(scheduler.scheduler_address)).made == 5
    assert files_of(out) == files_of(whole.folder)


def test_shards_that_overlap_in_a_process_work_on_one_thread_until_the_last_is_done():
    def threads():
        # Linear algebra's; an OpenMP runtime that another test has loaded is nothing that a shard computes with.
        return {library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas"}

    with threadpool_limits(limits=2):
        before = threads()
        first, second = one_thread(), one_thread()
        first.__enter__()
        with second:
            first.__exit__(None, None, None)
            assert threads() == {1}
        assert threads() == before


def test_a_worker_with_another_release_is_refused():
    check_releases("--scheduler x", {"taxel": "9"}, {"tcp://a": {"taxel": "9"}})
    with pytest.raises(ClusterError, match=r"^--scheduler x: worker tcp://b has taxel 8 instead of 9; install"):
        check_releases("--scheduler x", {"taxel": "9"}, {"tcp://a": {"taxel": "9"}, "tcp://b": {"taxel": "8"}})


def test_no_scheduler_is_one_line(whole):
    with pytest.raises(ClusterError, match=r"^--scheduler tcp://127.0.0.1:9: no Dask scheduler answers"):
        list(Cluster("tcp://127.0.0.1:9", patience_s=0.3).made(whole.recipe, [0]))


def test_without_dask_it_says_what_to_install(whole):
    with (
        mock.patch.dict(sys.modules, {"distributed": None}),
        pytest.raises(ClusterError, match=r"^--scheduler: Dask is not installed; pip install 'taxel\[cluster\]'$"),
    ):
        list(Cluster("tcp://127.0.0.1:8786").made(whole.recipe, [0]))
