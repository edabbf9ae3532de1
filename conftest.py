"""Profiles of Hypothesis for every test.

The default profile draws the same examples in every run, so that a test either fails always or never. With
`TAXEL_EXAMPLES=N` each property test draws N random examples instead, and a failure prints the code that repeats it.
"""

import os

from hypothesis import HealthCheck, settings

# How long a loaded machine takes to draw or run an example is no property of the code.
COMMON = {"deadline": None, "suppress_health_check": [HealthCheck.too_slow], "print_blob": True}

settings.register_profile("repeatable", derandomize=True, database=None, **COMMON)
settings.register_profile("random", max_examples=int(os.environ.get("TAXEL_EXAMPLES", "100")), **COMMON)
settings.load_profile("random" if "TAXEL_EXAMPLES" in os.environ else "repeatable")
