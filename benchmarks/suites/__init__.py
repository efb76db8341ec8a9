"""Benchmark suites, one module each: `run(options)` returns records, `tables(records)` formats them."""
