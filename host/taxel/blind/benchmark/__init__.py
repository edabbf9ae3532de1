"""Comparison of several diagnoses on the same worlds with hidden causes."""
