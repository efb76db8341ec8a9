"""Under which name Blender has enabled the add-on."""

from __future__ import annotations

#: The name of the whole package, such as bl_ext.user_default.hemibake.
EXTENSION = __package__.rpartition(".")[0]
