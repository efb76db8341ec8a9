"""How a bake is done: by which method, in how much memory, chosen by which trial."""
