"""Synthetic grasps at scale: drawn from a recipe, simulated on many processes, written as shards with an index."""
