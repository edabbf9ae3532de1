"""Collision-checked motion of arm and hand."""
