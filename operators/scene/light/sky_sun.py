"""Converts the sun discs of Sky Texture nodes to sun lights.

A disc is narrower than a pixel of the rendered world. Its irradiance is therefore the difference of two
zoomed renders of the whole world, with and without the discs. This includes strength, node groups and mixes.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import bpy
import numpy as np
from mathutils import Vector

from ....engine.scene.color import luminance
from ....engine.scene.model import Light
from ...compat import node_tree
from ..materials.tree_nodes import all_nodes
from .panorama import Zoom, render_zoom

#: Types of Sky Texture nodes with a sun disc; NISHITA is the name in Blender before 5.0.
_TYPES = frozenset({"NISHITA", "SINGLE_SCATTERING", "MULTIPLE_SCATTERING"})

#: Smallest disc in Cycles, radians (scene/shader_nodes.h, SkyTextureNode::get_sun_size).
_SMALLEST = 0.0005

#: Zoomed render of a disc: width in pixels, field of view in disc widths, and maximum field of view in
#: radians.
_PIXELS, _FIELD, _WIDEST = 64, 3.0, 2.6

#: Margin around a disc, as a fraction of its angular radius: more than half a pixel of a zoomed render.
_RIM = 0.1

#: Tolerances for equal discs: angle between their directions, radians, and ratio of their sizes.
_SAME, _SAME_SIZE = 1e-5, 1 + 1e-4


@dataclass(frozen=True)
class SunDisc:
    """A sun disc.

    direction:  (3,) float64 unit vector towards the disc
    size:       angular diameter, radians
    """

    direction: np.ndarray
    size: float

    def angle_to(self, other: SunDisc) -> float:
        """Return the angle between the directions of two discs, radians; accurate for small angles, too."""
        half = float(np.linalg.norm(self.direction - other.direction)) / 2
        return float(2 * np.arcsin(min(half, 1.0)))

    def is_same(self, other: SunDisc) -> bool:
        """Return True if both discs have the same direction and size within tolerances."""
        ratio = self.size / other.size
        return self.angle_to(other) < _SAME and 1 / _SAME_SIZE < ratio < _SAME_SIZE

    def overlaps(self, other: SunDisc) -> bool:
        """Return True if the discs overlap."""
        return self.angle_to(other) < (1 + _RIM) * (self.size + other.size) / 2


@contextmanager
def copied_world(world: bpy.types.World) -> Iterator[bpy.types.World]:
    """Yield a copy of a world and its node groups at the current frame; all are removed at the end."""
    copy = world.copy()
    groups: dict[bpy.types.NodeTree, bpy.types.NodeTree] = {}
    try:
        # Remove animation data, because the temporary scene would evaluate it at another frame.
        copy.animation_data_clear()
        if copy.node_tree is not None:
            _copy_groups(copy.node_tree, groups)
        yield copy
    finally:
        bpy.data.worlds.remove(copy)
        for group in groups.values():
            bpy.data.node_groups.remove(group)


def _copy_groups(tree: bpy.types.NodeTree, groups: dict[bpy.types.NodeTree, bpy.types.NodeTree]) -> None:
    """Replace the node groups of a tree by copies, recursively.

    groups:  the copy of each group, filled here
    """
    tree.animation_data_clear()
    for node in tree.nodes:
        group = getattr(node, "node_tree", None)
        if group is not None:
            if group not in groups:
                groups[group] = group.copy()
                _copy_groups(groups[group], groups)
            node.node_tree = groups[group]


def sky_nodes(tree: bpy.types.NodeTree | None) -> list[bpy.types.Node]:
    """Return the Sky Texture nodes of a tree and its groups whose sun disc is on."""
    return [node for node in all_nodes(tree) if _has_disc(node)]


def _has_disc(node: bpy.types.Node) -> bool:
    return (
        node.bl_idname == "ShaderNodeTexSky" and not node.mute and node.sky_type in _TYPES and node.sun_disc
    )


def _disc(node: bpy.types.Node) -> SunDisc:
    """Return the sun disc of a node; Cycles ignores the Vector input of these types."""
    elevation, rotation = node.sun_elevation, node.sun_rotation
    across = np.cos(elevation)
    direction = np.array([across * np.sin(rotation), across * np.cos(rotation), np.sin(elevation)])
    return SunDisc(direction, max(node.sun_size, _SMALLEST))


def has_overlapping_suns(world: bpy.types.World) -> bool:
    """Return True if sun discs of a world overlap, so that `take_suns` leaves them on."""
    return _overlap(_discs(sky_nodes(node_tree(world))))


def _discs(nodes: Sequence[bpy.types.Node]) -> list[SunDisc]:
    """Return the different sun discs of nodes."""
    discs: list[SunDisc] = []
    for disc in map(_disc, nodes):
        if not any(disc.is_same(known) for known in discs):
            discs.append(disc)
    return discs


def _overlap(discs: Sequence[SunDisc]) -> bool:
    return any(one.overlaps(other) for number, one in enumerate(discs) for other in discs[:number])


def take_suns(world: bpy.types.World, name: str, notes: list[str]) -> list[Light]:
    """Turn off the sun discs of a world and return them as sun lights without position and light group.

    Overlapping discs stay on, and a warning is appended to `notes`. Raises RuntimeError if Blender cannot
    render.

    world:  a copy, see `copied_world`
    name:   name of the original world
    """
    nodes = sky_nodes(node_tree(world))
    discs = _discs(nodes)
    if _overlap(discs):
        notes.append(
            f"World '{name}': sun discs overlap and are baked as an image of low resolution. "
            "Turn off Sun Disc in all but one Sky Texture."
        )
        return []
    vectors = _irradiance(world, nodes, discs)
    suns = [_sun(f"Sun of world '{name}'", disc, vector) for disc, vector in zip(discs, vectors, strict=True)]
    return [sun for sun in suns if sun.strength.any()]


def _irradiance(
    world: bpy.types.World, nodes: Sequence[bpy.types.Node], discs: Sequence[SunDisc]
) -> list[np.ndarray]:
    """Turn off discs; return the irradiance vector of each, (3, 3) float64 W/m^2: channels, xyz."""
    zooms = [Zoom(disc.direction, min(_FIELD * disc.size, _WIDEST), _PIXELS) for disc in discs]
    with_discs = [render_zoom(world, zoom) for zoom in zooms]
    for node in nodes:
        node.sun_disc = False
    vectors = []
    for disc, zoom, shown in zip(discs, zooms, with_discs, strict=True):
        radiance = np.maximum(shown - render_zoom(world, zoom), 0).astype(np.float64)
        directions, solid_angles = _pixels(zoom)
        distance = np.linalg.norm(directions - disc.direction, axis=2)
        inside = distance <= 2 * np.sin((1 + _RIM) * disc.size / 4)
        vectors.append(np.einsum("yxc,yxd,yx->cd", radiance, directions, solid_angles * inside))
    return vectors


def _pixels(zoom: Zoom) -> tuple[np.ndarray, np.ndarray]:
    """Return the pixels' unit directions, (h, w, 3) float64, and solid angles, (h, w) float64 sr."""
    edge = np.tan(zoom.field / 2)
    step = 2 * edge / zoom.pixels
    middles = (np.arange(zoom.pixels) + 0.5) * step - edge
    x, y = np.meshgrid(middles, middles)
    squared = 1 + x * x + y * y
    axes = np.array(zoom.rotation.to_matrix(), np.float64)
    directions = np.stack([x, y, -np.ones_like(x)], axis=2) @ axes.T / np.sqrt(squared)[..., None]
    return directions, step**2 / squared**1.5


def _sun(name: str, disc: SunDisc, vector: np.ndarray) -> Light:
    """Return a sun light of the disc's size and irradiance.

    Its axis has the direction of the irradiance vectors' luminance. A surface that the whole disc reaches
    gets the irradiance of the disc.

    vector:  (3, 3) float64, irradiance vector of each channel, W/m^2
    """
    towards = luminance(vector.T)
    length = float(np.linalg.norm(towards))
    towards = towards / length if length > 0 else disc.direction
    axes = np.array(Vector(towards).to_track_quat("Z", "Y").to_matrix(), np.float64).T
    return Light(
        name=name,
        kind="sun",
        position=np.zeros(3),
        axes=axes,
        strength=np.maximum(vector @ towards, 0).astype(np.float32),
        half_angle=disc.size / 2,
        of_world=True,
    )
