"""Grasps of known objects: shapes, grasp plan, controller, arm reach and calibrated poses."""
