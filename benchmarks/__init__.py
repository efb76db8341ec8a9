"""Measures Hemibake: `make bench`, `make bench-gpu`; docs/benchmarks.md explains the tables."""
