"""Grasp campaigns: the same intended grasps on the emulated hand, in the simulator, or on a physical hand."""
