"""Grasps of known objects: where the objects and the brackets are, and what the skin felt of them."""
