"""Hypothesis for every test: how long a loaded machine takes to draw or run an example is no finding."""

from hypothesis import HealthCheck, settings

settings.register_profile("taxel", deadline=None, suppress_health_check=[HealthCheck.too_slow], print_blob=True)
settings.load_profile("taxel")
