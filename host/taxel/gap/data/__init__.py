"""Reads a real and a simulated dataset, pairs their conditions, aligns the times, and finds faulty simulated grasps."""
