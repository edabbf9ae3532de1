"""Shards that one process makes side by side: linear algebra has one thread from the first to the last."""

from __future__ import annotations

from unittest import mock

import numpy as np
from threadpoolctl import threadpool_info

import taxel.generate.one_thread as module
from taxel.generate.one_thread import OneThread


def test_the_first_sets_the_number_of_threads_and_the_last_gives_it_back():
    with mock.patch.object(module, "threadpool_limits") as limits:
        shards = OneThread()
        first, second = shards.held(), shards.held()
        first.__enter__()
        with second:
            first.__exit__(None, None, None)
            limits.assert_called_once_with(limits=1)
            limits.return_value.restore_original_limits.assert_not_called()
        limits.return_value.restore_original_limits.assert_called_once_with()
        with shards.held():
            assert limits.call_count == 2  # and the next begins anew
        assert limits.return_value.restore_original_limits.call_count == 2


def test_linear_algebra_has_one_thread_meanwhile():
    with OneThread().held():
        np.eye(2) @ np.eye(2)
        assert {library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas"} == {1}
