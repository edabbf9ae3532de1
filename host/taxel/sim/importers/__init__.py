"""Import of recordings of other programs as grasp datasets."""
