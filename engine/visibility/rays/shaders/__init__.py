"""Rays cast by OpenGL compute shaders: the ray tracer of machines without OpenCL."""
