"""A real Blender window on a screen that nobody sees, driven by mouse and keyboard."""
