"""What bakes have found, in files: an interrupted bake goes on from there."""
