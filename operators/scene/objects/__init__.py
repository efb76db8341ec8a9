"""Lists the objects and instances that a render shows, and reads their meshes."""
