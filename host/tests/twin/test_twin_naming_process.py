"""The background process that names a cause is terminated from outside, for example because memory is exhausted."""

from concurrent.futures import Future
from concurrent.futures.process import BrokenProcessPool
from unittest.mock import Mock

from taxel.twin.naming import CauseNaming
from taxel.twin.schedule import Contact


def test_a_terminated_naming_process_is_reported_and_the_naming_continues():
    naming = CauseNaming(Mock(), is_live=True)
    naming._contacts = [(Contact((0.0, 1.0, 2.0, 3.0, 4.0), ("block", "top")), Mock())]
    naming._pool = Mock()
    naming._pending = Future()
    naming._pending.set_exception(BrokenProcessPool())
    (event,) = naming.finish()
    assert (event.time_s, event.kind) == (4.0, "cause")
    assert "terminated from outside" in event.message
    # The next diagnosis starts a new pool.
    assert naming._pool is None
    assert naming._pending is None
