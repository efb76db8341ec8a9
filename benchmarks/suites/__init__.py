"""One suite a module: `run(options)` returns records, `tables(records)` shows them."""
