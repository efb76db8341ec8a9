"""Ray tracing with a bounding volume hierarchy (BVH) by OpenCL."""
