"""Shares of the gap by sensor, line, taxel, phase, object and approach, with p-values."""
