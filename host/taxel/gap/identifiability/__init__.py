"""Which effects and parameters these grasps can distinguish; classes of confounded effects."""
