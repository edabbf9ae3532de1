"""Identifiability: effects that the recorded grasps excite and distinguish, and classes of confounded effects."""
