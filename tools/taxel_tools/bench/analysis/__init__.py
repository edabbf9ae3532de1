"""Arithmetic on a board's counts."""
