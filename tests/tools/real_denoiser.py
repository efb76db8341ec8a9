"""The Open Image Denoise of the bpy package of this Python, for tests that need a real one."""

from importlib.util import find_spec
from pathlib import Path

import pytest

from engine.denoise.found import library_of_blender, library_of_packages

_BPY = find_spec("bpy")

#: None if there is none.
LIBRARY = (_BPY and library_of_blender(Path(_BPY.origin).parent)) or library_of_packages()

#: Marks tests that need it.
needs_library = pytest.mark.skipif(LIBRARY is None, reason="There is no Open Image Denoise.")
