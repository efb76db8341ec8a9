"""Rays through a hierarchy of boxes, with OpenCL."""
