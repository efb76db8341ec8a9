"""Reference solutions for tests of the GPU path: form factors, Gauss-Seidel, hemicubes on the CPU."""
