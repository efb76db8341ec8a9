"""Scene data of a bake, its validation and its content hashes."""
