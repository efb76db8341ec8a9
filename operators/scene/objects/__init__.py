"""What a render shows, and its meshes."""
