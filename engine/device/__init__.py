"""The GL context, the CL queue, the copy between them, and the loading of shaders and kernels."""
