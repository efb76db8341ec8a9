"""Name under which Blender has enabled the add-on."""

from __future__ import annotations

#: Name of the root package, such as bl_ext.user_default.hemibake.
EXTENSION = __package__.rpartition(".")[0]
