"""Devices: OpenGL context, OpenCL queue and buffers, and the loading of shaders and kernels."""
