"""Comparison of sets of effects by held-out prediction, with calibrated probabilities."""
