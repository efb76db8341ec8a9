"""The same kernels in GLSL, OpenCL and CUDA (paper, VI.C), and their times."""
