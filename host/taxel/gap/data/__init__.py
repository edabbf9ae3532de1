"""Reads a real and a simulated dataset, pairs and aligns them in time, and identifies faulty simulator grasps."""
