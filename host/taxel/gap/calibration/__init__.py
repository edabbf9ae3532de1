"""Calibration of the probabilities on worlds with known causes."""
