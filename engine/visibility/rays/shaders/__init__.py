"""Ray tracing by OpenGL compute shaders, for machines without OpenCL."""
