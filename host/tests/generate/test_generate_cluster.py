"""Generation on a Dask cluster: the same bytes as on one computer, and one-line error messages."""

import copyreg
import sys
from unittest import mock

import pytest

from taxel.generate.cluster import Cluster, check_releases
from taxel.generate.errors import ClusterError
from taxel.generate.run import generate
from taxel.optional import MissingPackageError

PICKLERS = dict(copyreg.dispatch_table)
distributed = pytest.importorskip("distributed")
copyreg.dispatch_table.clear()  # distributed registers a pickler for all exceptions of the process
copyreg.dispatch_table.update(PICKLERS)


@pytest.fixture(scope="module")
def scheduler():
    """Yield a Dask cluster with two workers in this process."""
    options = {"host": "127.0.0.1", "protocol": "tcp://", "processes": False, "dashboard_address": None}
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, **options) as local:
        assert local.scheduler_address.startswith("tcp://127.0.0.1:")
        yield local


def test_cluster_generates_the_same_bytes_as_one_local_process(generated, read_files, scheduler, tmp_path):
    out = tmp_path / "cluster"
    assert generate(generated.recipe, out, Cluster(scheduler.scheduler_address)).generated_grasps == 3
    assert read_files(out) == read_files(generated.folder)


def test_workers_with_the_same_releases_are_accepted():
    check_releases("--scheduler x", {"taxel": "9"}, {"tcp://a": {"taxel": "9"}})


def test_worker_with_another_release_is_refused():
    with pytest.raises(ClusterError, match=r"^--scheduler x: worker tcp://b has taxel 8 instead of 9; install"):
        check_releases("--scheduler x", {"taxel": "9"}, {"tcp://a": {"taxel": "9"}, "tcp://b": {"taxel": "8"}})


def test_missing_scheduler_is_refused(small_recipe):
    with pytest.raises(ClusterError, match=r"^--scheduler tcp://127.0.0.1:9: no Dask scheduler answers"):
        list(Cluster("tcp://127.0.0.1:9", timeout_s=0.3).generate_shards(small_recipe, [0]))


def test_missing_dask_gives_the_install_command(small_recipe):
    with (
        mock.patch.dict(sys.modules, {"distributed": None}),
        pytest.raises(MissingPackageError, match=r"^--scheduler needs .*: pip install 'taxel\[cluster\]'$"),
    ):
        list(Cluster("tcp://127.0.0.1:8786").generate_shards(small_recipe, [0]))
