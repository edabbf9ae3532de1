"""Settings of every test: one BLAS thread per process, and the profiles of Hypothesis.

Test processes run in parallel on all cores: the threads of OpenBLAS would only wait for each other, which takes several
times the processor time of the computation.

The default profile draws the same examples in every run, so that a test either fails always or never. With
`TAXEL_EXAMPLES=N` each property test draws N random examples instead, and a failure prints the code that repeats it.
"""

import gc
import os
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

# Before the first import of numpy, and inherited by the processes that tests start.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# How long a loaded machine takes to draw or run an example is no property of the code.
COMMON = {"deadline": None, "suppress_health_check": [HealthCheck.too_slow], "print_blob": True}

settings.register_profile("repeatable", derandomize=True, database=None, **COMMON)
settings.register_profile("random", max_examples=int(os.environ.get("TAXEL_EXAMPLES", "100")), **COMMON)
settings.load_profile("random" if "TAXEL_EXAMPLES" in os.environ else "repeatable")


# Collection creates millions of objects that stay until the end of the run. The garbage collector would visit them
# repeatedly, which takes a third of the time of the collection.
gc.disable()


SLOW_TESTS = Path(__file__).parent / "host" / "tests" / "slow_tests.txt"


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark the tests in `slow_tests.txt` as slow: `make test` omits them, and `make test-slow` runs them.

    The second mark, `listed`, distinguishes these tests from tests that are marked as slow in their own source.
    """
    lines = SLOW_TESTS.read_text(encoding="utf-8").splitlines()
    slow = {line for line in lines if not line.startswith("#")}
    for item in items:
        if item.nodeid in slow:
            item.add_marker(pytest.mark.slow)
            item.add_marker(pytest.mark.listed)


def pytest_collection_finish() -> None:
    """Enable the garbage collector for the objects that the tests create."""
    gc.freeze()
    gc.enable()
