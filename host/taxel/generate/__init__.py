"""Synthetic grasps at scale: sampled from a recipe, simulated in many processes, written to dataset files (shards)."""
