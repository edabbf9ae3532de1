"""Shards that one process generates at the same time: linear algebra uses one thread until the last one is finished."""

from unittest import mock

import numpy as np
from threadpoolctl import threadpool_info

import taxel.generate.single_thread as module
from taxel.generate.single_thread import SingleThreadLimit


def test_first_shard_sets_the_limit_of_one_thread_and_last_shard_restores_the_original_limits():
    with mock.patch.object(module, "threadpool_limits") as limits:
        limit = SingleThreadLimit()
        first, second = limit.apply(), limit.apply()
        first.__enter__()
        with second:
            first.__exit__(None, None, None)
            limits.assert_called_once_with(limits=1)
            limits.return_value.restore_original_limits.assert_not_called()
        limits.return_value.restore_original_limits.assert_called_once_with()
        with limit.apply():
            assert limits.call_count == 2  # the next shard sets the limit again
        assert limits.return_value.restore_original_limits.call_count == 2


def test_linear_algebra_uses_one_thread_inside_the_block():
    with SingleThreadLimit().apply():
        np.eye(2) @ np.eye(2)
        assert {library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas"} == {1}
