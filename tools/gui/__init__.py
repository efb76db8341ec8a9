"""A real Blender window on a virtual screen, driven by mouse and keyboard."""
