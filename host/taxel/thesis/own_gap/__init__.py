"""Differences between hardware and simulation in the original programs, and their shares of the thesis's distance."""
