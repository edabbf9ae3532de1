"""Turn what other programs recorded into grasp datasets."""
