"""Engines that *Export for Engine* writes files for, and what each of them needs."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

#: Folder of the add-ons for engines.
_CLIENTS = Path(__file__).resolve().parents[1] / "clients"


@dataclass(frozen=True)
class Engine:
    """An engine as a choice of the export.

    label, text:  name and tool-tip in the interface
    help:         sentence on what shows the lightmaps in the engine
    page:         name of its page in docs/engines; empty for none
    client:       folder of its add-on in `clients`; empty for none
    lightmaps:    how the glTF file holds lightmaps: "HDR", "PNG" or "NONE"
    use_files:    True to write OpenEXR files and the manifest
    for_godot:    True to write Godot's own files
    for_unity:    True to write light probes for Unity and VRChat
    is_unlit:     True to write complete maps, albedo x light + emission, instead of lightmaps
    options:      properties of the operator that are shown
    """

    label: str
    text: str
    help: str = ""
    page: str = ""
    client: str = ""
    lightmaps: str = "NONE"
    use_files: bool = True
    for_godot: bool = False
    for_unity: bool = False
    is_unlit: bool = False
    options: tuple[str, ...] = ()

    @property
    def is_custom(self) -> bool:
        """True if the operator's own options choose lightmaps and files."""
        return "use_files" in self.options

    @property
    def folder(self) -> Path | None:
        """Folder of its add-on; None if this package has none."""
        folder = _CLIENTS / self.client
        return folder if self.client and folder.is_dir() else None


#: Engines by name, in the order of the interface. The last one has the options of the operator.
ENGINES = {
    "THREE": Engine(
        "three.js", "Write one .glb that holds the lightmaps, for three.js and Hubs",
        "The npm package hemibake-three loads the file", "three.md", "three",
        lightmaps="HDR", use_files=False,
    ),
    "GODOT": Engine(
        "Godot", "Write a scene that Godot 4.6 opens with its lightmaps",
        "Open the .tscn. The add-on is only needed for .glb files with lightmaps inside", "godot.md", "godot",
        use_files=False, for_godot=True,
    ),
    "BEVY": Engine(
        "Bevy", "Write a .glb and OpenEXR lightmaps for Bevy 0.18",
        "The crate bevy_hemibake shows the lightmaps", "bevy.md", "bevy",
    ),
    "UNITY": Engine(
        "Unity", "Write a .glb and OpenEXR lightmaps for Unity",
        "Components assign the lightmaps and light probes", "unity.md", "unity", for_unity=True,
    ),
    "UNREAL": Engine(
        "Unreal", "Write a .glb and OpenEXR lightmaps for Unreal Engine",
        "A material function shows the lightmaps", "unreal.md", "unreal",
    ),
    "UNLIT": Engine(
        "Unlit", "Write pictures of all light and color, for Second Life, Roblox, phones and any viewer",
        "Every reader of glTF shows the file, without an add-on", "unlit.md",
        use_files=False, is_unlit=True,
        options=("file_format", "picture_format", "picture_size", "picture_exposure"),
    ),
    "FILES": Engine(
        "Files", "Choose the format and the files", options=("file_format", "lightmaps", "use_files")
    ),
}  # fmt: skip


def engine_items() -> list[tuple[str, str, str]]:
    """Return the items of an enumeration of all engines."""
    return [(name, engine.label, engine.text) for name, engine in ENGINES.items()]
