"""One bake on many devices: Dask workers find and keep what blocks of patches see, and gather for them.

Nothing else of the engine imports Dask; `session` imports this package where the settings name a scheduler.
"""
