"""Grasp campaigns: the same planned grasps on the emulated hand, in the simulator or on a physical hand."""
