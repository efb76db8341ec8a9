"""What stands in the way of a good bake, and what the bake will take: found before it starts."""

from .checking import check_scene
from .finding import Checked, Finding
from .uvs import without_moved

__all__ = ["Checked", "Finding", "check_scene", "without_moved"]
