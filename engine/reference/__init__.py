"""The slow truth the GPU path is measured against: form factors, Gauss-Seidel, hemicubes on the CPU."""
