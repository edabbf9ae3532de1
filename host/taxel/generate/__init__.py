"""Synthetic grasps at scale: sampled from a recipe, simulated by many processes, written as shards with an index."""
