"""The same kernels in GLSL, OpenCL and CUDA (paper, VI.C): what each framework takes for them."""
