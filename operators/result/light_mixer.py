"""Node group that mixes light groups in the preview, with a color and a strength for each.

Colors and strengths are nodes inside the group, which all preview materials of a scene share. A change shows
at once, and they support keyframes and drivers.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence

import bpy

from .light_states import Mix, rename_groups
from .nodes import make_node

#: Width of a node column, and height of the rows of a light group.
_COLUMN, _ROW = 200, 220

#: Custom property with the members of each light group at the last update.
_MEMBERS = "hemibake_members"


def group_images(
    scene: bpy.types.Scene, lightmaps: Sequence[bpy.types.Image]
) -> dict[str, tuple[bpy.types.Image, ...]]:
    """Return the maps of each light group of several lightmaps, by name; empty if one is missing.

    Maps of an earlier bake than a lightmap's last one are ignored.
    """
    found = [_maps_beside(scene, lightmap) for lightmap in lightmaps]
    if not found or any(maps.keys() != found[0].keys() for maps in found):
        return {}
    return {name: tuple(maps[name] for maps in found) for name in found[0]}


def _maps_beside(scene: bpy.types.Scene, lightmap: bpy.types.Image) -> dict[str, bpy.types.Image]:
    """Return the light group maps of a lightmap, by group."""
    entries = scene.hemibake.lightmaps
    atlas = next((entry.name for entry in entries if entry.image == lightmap), None)
    if atlas is None or not entries[atlas].light_groups:
        return {}
    names = json.loads(entries[atlas].light_groups)
    found = {name: entries.get(f"{atlas} light group {name}") for name in names}
    if not all(entry and entry.image and entry.image.size[0] for entry in found.values()):
        return {}
    return {name: entry.image for name, entry in found.items()}


def light_mixer(scene: bpy.types.Scene, groups: Sequence[str]) -> bpy.types.NodeTree:
    """Return the mixer of a scene, with an input for each light group in order.

    Colors and strengths of existing groups are kept with their animation, even if a group was renamed. Light
    states follow renamed groups too.
    """
    tree = scene.hemibake.light_mixer
    if tree is None or _is_of_another(tree, scene):
        tree = bpy.data.node_groups.new("Light Mixer", "ShaderNodeTree") if tree is None else tree.copy()
        scene.hemibake.light_mixer = tree
    known, members = json.loads(tree.get(_MEMBERS, "{}")), group_members(scene)
    if _inputs(tree) != list(groups):
        renamed = renamed_groups(known, members)
        _rename(tree, renamed)
        rename_groups(scene, renamed)
        _build(tree, groups)
    if members != known:
        tree[_MEMBERS] = json.dumps(members)
    return tree


def mixed_groups(tree: bpy.types.NodeTree) -> list[tuple[str, bpy.types.NodeSocket, bpy.types.NodeSocket]]:
    """Return each light group of a mixer, with the sockets of its color and strength."""
    nodes = tree.nodes
    return [
        (name, nodes[_color(name)].outputs[0], nodes[_strength(name)].outputs[0])
        for name in _inputs(tree)
        if _color(name) in nodes and _strength(name) in nodes
    ]


def mixer_mix(tree: bpy.types.NodeTree) -> dict[str, Mix]:
    """Return the present color and strength of each light group of a mixer."""
    return {
        name: (tuple(color.default_value)[:3], strength.default_value)
        for name, color, strength in mixed_groups(tree)
    }


def set_mixer_mix(tree: bpy.types.NodeTree, mix: Mapping[str, Mix]) -> None:
    """Set color and strength of the light groups of a mixer; other groups stay unchanged."""
    for name, color, strength in mixed_groups(tree):
        if name in mix:
            rgb, strength.default_value = mix[name]
            color.default_value = (*rgb, 1.0)


def _is_of_another(tree: bpy.types.NodeTree, scene: bpy.types.Scene) -> bool:
    """Return True if another scene also uses the mixer, which happens after a scene was copied."""
    return any(other.hemibake.light_mixer == tree for other in bpy.data.scenes if other != scene)


def _inputs(tree: bpy.types.NodeTree) -> list[str]:
    """Return the names of a mixer's inputs."""
    return [item.name for item in tree.interface.items_tree if item.in_out == "INPUT"]


def _color(group: str) -> str:
    return f"{group} Color"


def _strength(group: str) -> str:
    return f"{group} Strength"


def _rename(tree: bpy.types.NodeTree, names: Mapping[str, str]) -> None:
    """Rename the color and strength nodes after renamed light groups; animation follows."""
    for old, new in names.items():
        for name in (_color, _strength):
            node = tree.nodes.get(name(old))
            if node is not None and name(new) not in tree.nodes:
                node.name = node.label = name(new)


def _build(tree: bpy.types.NodeTree, groups: Sequence[str]) -> None:
    """Create inputs and nodes for groups; existing color and strength nodes are kept."""
    kept = {name(group) for group in groups for name in (_color, _strength)}
    for node in [node for node in tree.nodes if node.name not in kept]:
        tree.nodes.remove(node)
    tree.interface.clear()
    for group in groups:
        tree.interface.new_socket(group, in_out="INPUT", socket_type="NodeSocketVector")
    tree.interface.new_socket("Light", in_out="OUTPUT", socket_type="NodeSocketVector")

    # Light = sum of map x color x strength.
    inputs = tree.nodes.new("NodeGroupInput")
    light: bpy.types.NodeSocket | tuple[float, ...] = (0.0, 0.0, 0.0)
    for row, group in enumerate(groups):
        at = [(column * _COLUMN, -row * _ROW) for column in range(1, 5)]
        color = _holder(tree, "ShaderNodeRGB", _color(group), at[0], (1.0, 1.0, 1.0, 1.0))
        strength = _holder(tree, "ShaderNodeValue", _strength(group), (at[0][0], at[0][1] - _ROW / 2), 1.0)
        scaled = make_node(tree, "ShaderNodeVectorMath", at[1], color, operation="SCALE")
        tree.links.new(strength, scaled.node.inputs["Scale"])
        feeds = (inputs.outputs[row], scaled, light)
        light = make_node(tree, "ShaderNodeVectorMath", at[2], *feeds, operation="MULTIPLY_ADD")
    output = tree.nodes.new("NodeGroupOutput")
    output.location = (5 * _COLUMN, 0)
    tree.links.new(light, output.inputs[0])


def _holder(
    tree: bpy.types.NodeTree, kind: str, name: str, at: tuple[float, float], value: object
) -> bpy.types.NodeSocket:
    """Return the output of the value node with this name; create the node if it is missing."""
    node = tree.nodes.get(name)
    if node is None:
        node = tree.nodes.new(kind)
        node.name = node.label = name
        node.outputs[0].default_value = value
    node.location = at
    return node.outputs[0]


#: Key of the world among the members of a light group; no object has an empty name.
_WORLD = ""

#: Names of the members of each light group.
Members = Mapping[str, Sequence[str]]


def group_members(scene: bpy.types.Scene) -> dict[str, list[str]]:
    """Return the names of the objects in each light group of a scene that has members, with its world."""
    members: dict[str, list[str]] = {}
    for obj in scene.objects:
        members.setdefault(obj.lightgroup, []).append(obj.name)
    if scene.world is not None:
        members.setdefault(scene.world.lightgroup, []).append(_WORLD)
    members.pop("", None)
    return members


def renamed_groups(before: Members, after: Members) -> dict[str, str]:
    """Return the new name of each missing light group: a new group with most of its members."""
    gone = [name for name in before if name not in after]
    new = [name for name in after if name not in before]
    found: dict[str, str] = {}
    for old in gone:
        mine = set(before[old])
        heirs = [name for name in new if 2 * len(mine & set(after[name])) > len(mine)]
        found.update((old, heir) for heir in heirs)
    return found
