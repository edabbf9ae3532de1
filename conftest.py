"""Hypothesis settings of every test: no limit on the duration of an example, because a loaded machine is slow."""

from hypothesis import HealthCheck, settings

settings.register_profile("taxel", deadline=None, suppress_health_check=[HealthCheck.too_slow], print_blob=True)
settings.load_profile("taxel")
