"""Options of an export for an engine."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class PictureOptions:
    """Complete maps: sRGB pictures of albedo x light + emission.

    kind:      MIME type, "image/png" or "image/jpeg"
    width:     texels; 0 for the width of each lightmap
    exposure:  stops
    """

    kind: str
    width: int
    exposure: float


@dataclass(frozen=True)
class ExportOptions:
    """Contents of an export.

    kind:       MIME type of the lightmaps in the glTF file; "" for none
    use_files:  True to write the lightmaps as OpenEXR files with a manifest as well
    for_godot:  True to write the files by which Godot shows them instead
    for_unity:  True to write the light probes for Unity as well
    pictures:   complete maps instead of lightmaps; None for lightmaps
    """

    kind: str = ""
    use_files: bool = False
    for_godot: bool = False
    pictures: PictureOptions | None = None
    for_unity: bool = False
