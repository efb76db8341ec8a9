"""Measures Hemibake: `make bench`, `make bench-gpu`; docs/design/benchmarks.md explains the tables."""
