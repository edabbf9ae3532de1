"""Test of one sensor board: measurements and named faults."""
