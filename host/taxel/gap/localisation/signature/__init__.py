"""Signature of the remainder: comparison of the unexplained part of the gap with generic distortions."""
