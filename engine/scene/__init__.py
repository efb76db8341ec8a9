"""What is baked: the data of a scene, and the checks on it."""
