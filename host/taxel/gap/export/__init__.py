"""Diagnosed effects as files for other simulators: a Python module, MJCF, Isaac Lab and Genesis configurations."""
