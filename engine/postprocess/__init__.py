"""What is done to a lightmap after the light is known; for display only."""
