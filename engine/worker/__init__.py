"""The bake in a process of its own."""
