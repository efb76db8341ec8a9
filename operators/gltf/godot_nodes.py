"""Paths of nodes in scenes that Godot 4.5 or newer imports from glTF files.

The rules follow Godot's sources: `GLTFDocument::_assign_node_names` makes names valid and unique, and
`ResourceImporterScene::_pre_fix_node` gives suffixes such as "-col" their meaning.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence

#: Characters that Godot replaces by "_" in names of nodes.
_INVALID = re.compile(r'[.:@/"%]')

#: Names of unnamed nodes, by the type of their content.
_UNNAMED = {"mesh": "Mesh", "camera": "Camera"}

#: End of a name that Godot ignores when it looks for a suffix: digits, underscores and white space.
_TAIL = re.compile(r"[0-9_\x00-\x20]*\Z")

#: Suffixes of nodes that Godot deletes with their children.
_DELETED = ("noimp",)

#: Suffixes of meshes that Godot replaces by something without a mesh.
_REPLACED = ("colonly", "convcolonly", "navmesh")

#: Suffixes of meshes that Godot renames.
_RENAMED = ("col", "convcol", "occ")

#: Suffixes of nodes that get a parent of the same name.
_ENCLOSED = ("vehicle", "wheel")


class _Node:
    """A node of the scene tree to which the rules of Godot's importer are applied.

    name:      its name
    index:     index in the glTF file; None for nodes that Godot adds
    has_mesh:  True if it shows a mesh
    children:  its children
    """

    def __init__(self, name: str, index: int | None, has_mesh: bool) -> None:
        self.name, self.index, self.has_mesh = name, index, has_mesh
        self.children: list[_Node] = []


def mesh_paths(gltf: Mapping) -> dict[int, str]:
    """Return the path from the scene's root to each node with a mesh, by its index in a glTF file."""
    root = _Node("", None, has_mesh=False)
    names = _unique_names(gltf.get("nodes", ()))
    root.children = [_tree(gltf, names, number) for number in gltf["scenes"][gltf.get("scene", 0)]["nodes"]]
    _apply_suffixes(root)
    return dict(_paths(root, ""))


def _unique_names(nodes: Sequence[Mapping]) -> list[str]:
    """Return the valid and unique names of nodes, in order."""
    names: list[str] = []
    taken: set[str] = set()
    for node in nodes:
        unnamed = next((name for key, name in _UNNAMED.items() if key in node), "Node")
        name = _INVALID.sub("_", node.get("name") or unnamed)
        unique, number = name, 2
        while unique in taken:
            unique, number = f"{name}{number}", number + 1
        taken.add(unique)
        names.append(unique)
    return names


def _tree(gltf: Mapping, names: Sequence[str], number: int) -> _Node:
    node = gltf["nodes"][number]
    made = _Node(names[number], number, "mesh" in node)
    made.children = [_tree(gltf, names, child) for child in node.get("children", ())]
    return made


def _apply_suffixes(parent: _Node) -> None:
    """Apply the suffixes of the names of all descendants of a node, children first."""
    for child in list(parent.children):
        _apply_suffixes(child)
        place = parent.children.index(child)
        parent.children[place : place + 1] = _imported(child, parent)


def _imported(node: _Node, parent: _Node) -> list[_Node]:
    """Return the nodes that Godot's import makes from a node: the node, its replacement, or none."""
    if _suffix(node.name, _DELETED):
        return []
    if found := _suffix(node.name, _REPLACED):
        if node.has_mesh:
            node.name, node.has_mesh = _without(node.name, found), False
        return [node]
    if node.has_mesh and _suffix(node.name, ("rigid",)):
        return [_enclosed(node, _without(node.name, "rigid_body"))]
    if node.has_mesh and (found := _suffix(node.name, _RENAMED)):
        name = _without(node.name, found)
        if name and all(other.name != name for other in parent.children):
            node.name = name
        return [node]
    if node.has_mesh and _suffix(node.name, ("occonly",)):
        return []
    if found := _suffix(node.name, _ENCLOSED):
        node.name = _without(node.name, found)
        return [_enclosed(node, node.name)]
    return [node]


def _enclosed(node: _Node, name: str) -> _Node:
    """Return a new node with a node and its former children as children."""
    made = _Node(name, None, has_mesh=False)
    made.children, node.children = [*node.children, node], []
    return made


def _suffix(name: str, suffixes: Sequence[str]) -> str | None:
    """Return the first of several suffixes that a name has, regardless of case."""
    plain = _TAIL.sub("", name).lower()
    for suffix in suffixes:
        if f"${suffix}" in plain or plain.endswith((f"-{suffix}", f"_{suffix}")):
            return suffix
    return None


def _without(name: str, suffix: str) -> str:
    """Return a name without a suffix; the end that Godot ignores stays only if the suffix is there."""
    plain = _TAIL.sub("", name)
    end = name[len(plain) :]
    if f"${suffix}" in plain.lower():
        return plain.replace(f"${suffix}", "") + end
    if plain.lower().endswith((f"-{suffix}", f"_{suffix}")):
        return plain[: -len(suffix) - 1] + end
    return plain


def _paths(node: _Node, path: str) -> Iterator[tuple[int, str]]:
    for child in node.children:
        own = f"{path}/{child.name}" if path else child.name
        if child.has_mesh and child.index is not None:
            yield child.index, own
        yield from _paths(child, own)
