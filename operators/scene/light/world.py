"""Converts world nodes to the sky's radiance and sun lights."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import bpy
import numpy as np

from ....engine.scene.color import srgb_to_linear
from ....engine.scene.sky_maps import shrink_sky_in_slices
from ...compat import node_input, node_tree
from ..materials.evaluation_digest import world_digest
from ..materials.materials import ShaderReader
from ..materials.pixels import PixelCache, PixelsNeededError, is_plain, is_srgb
from ..materials.ray_kinds import BOUNCE
from ..materials.sockets import ComplexError, feeding_socket
from ..materials.substitution import Substitution
from ..scene_watch import SceneWatch
from ..slice_timer import Slices, row_slices
from ..temporary_scene import share_properties
from .kept_worlds import ReadWorld, kept_worlds
from .refined_panorama import render_refined
from .sky_sun import copied_world, take_suns

#: Maximum number of rows of the sky's map: images up to 8k keep their resolution. A map of this size takes
#: 400 MB, and its bake three times as much.
_ROWS = 4096

#: Minimum numbers of rows and columns of a map that is turned (chosen).
_TURNED = 256, 512

#: Points at which a turned map is read, in all; each pixel is the mean of a square of points (chosen).
_POINTS = 1 << 23

#: Negative radiance that counts as rounding of a render, W/(m^2 sr).
_ROUNDING = 1e-6


def read_world(watch: SceneWatch, notes: list[str], cache: PixelCache) -> Slices[ReadWorld]:
    """Return the radiance and suns of the scene's world.

    A constant colour and an equirectangular image are read exactly. All other worlds are rendered by Blender.
    Sentences on what cannot be converted are appended to `notes`.
    """
    while True:
        watch.depsgraph()
        try:
            environment = _read(watch.context.world, notes, cache)
        except PixelsNeededError as unread:
            yield from unread.reading
            continue
        except ComplexError:
            return (yield from _rendered(watch, notes))
        if isinstance(environment, np.ndarray):
            return ReadWorld(environment)
        return ReadWorld((yield from environment.radiance()))


def _read(world: bpy.types.World | None, notes: list[str], cache: PixelCache) -> np.ndarray | _Environment:
    """Return a constant colour or an image; raises ComplexError if only Blender can render the world."""
    if world is None or not world.cycles_visibility.diffuse:
        return np.zeros(3, np.float32)
    tree = node_tree(world)
    if tree is None:
        return np.array(world.color, np.float32)[:3]
    output = tree.get_output_node("CYCLES")
    if output is None:
        return np.zeros(3, np.float32)
    owner = f"World '{world.name}'"
    shader = feeding_socket(output.inputs["Surface"])
    reader = ShaderReader(owner, notes)
    if shader.is_output and shader.node.bl_idname == "ShaderNodeBackground":
        colour = feeding_socket(node_input(shader.node, "Color"))
        if colour.is_output and colour.node.bl_idname == "ShaderNodeTexEnvironment":
            strength = reader.number(shader.node, "Strength").number
            return _environment(
                colour.node, owner, cache, float(_not_negative(np.array(strength), owner, notes))
            )
    emission = reader.surface(output.inputs["Surface"]).solid().emit
    return _not_negative(emission.constant, owner, notes).astype(np.float32)


def _rendered(watch: SceneWatch, notes: list[str]) -> Slices[ReadWorld]:
    """Render a world by Blender, or return it from the cache; a world that cannot be rendered is black."""
    world = watch.context.world
    assert world is not None
    digest = world_digest(world)
    kept = kept_worlds.get(digest)
    if kept is not None:
        notes += kept.notes
        return kept
    yield f"Rendering world '{world.name}'"
    watch.depsgraph()
    world, warnings = watch.context.world, list[str]()
    assert world is not None
    try:
        with copied_world(world) as copy, _seen_by_bounces(copy):
            share_properties(watch.context, copy)
            suns = take_suns(copy, world.name, warnings)
            radiance = _not_negative(render_refined(copy), f"World '{world.name}'", warnings)
            read = ReadWorld(radiance, tuple(suns), tuple(warnings))
    except RuntimeError as error:
        reason = str(error).strip().splitlines()[-1]
        notes.append(f"Blender could not render the world '{world.name}' ({reason}): it is baked black.")
        return ReadWorld(np.zeros(3, np.float32))
    finally:
        watch.accept()
    kept_worlds.keep(digest, read)
    notes += warnings
    return read


def _not_negative(radiance: np.ndarray, owner: str, notes: list[str]) -> np.ndarray:
    """Replace negative light by 0, and append a note on it."""
    if (radiance < -_ROUNDING).any():
        notes.append(f"{owner} has negative light, for which 0 is baked. Correct its color and strength.")
    return np.maximum(radiance, 0)


@contextmanager
def _seen_by_bounces(world: bpy.types.World) -> Iterator[None]:
    """Replace Light Path nodes in a copied world by their values for diffuse bounces."""
    substitution = Substitution(None, BOUNCE)
    try:
        if node_tree(world) is not None:
            substitution.apply(world.node_tree)
        yield
    finally:
        substitution.remove()


@dataclass(frozen=True)
class _Environment:
    """An environment texture.

    pixels:    (h, w, 3) float32 RGB
    srgb:      True if the pixels are sRGB-encoded
    turn:      (3, 3) float64 matrix that a Mapping node applies to directions; None without one
    strength:  strength of the Background shader
    """

    pixels: np.ndarray
    srgb: bool
    turn: np.ndarray | None
    strength: float

    def radiance(self) -> Slices[np.ndarray]:
        """Return the radiance as an equirectangular map, (h, w, 3) float32, of at most _ROWS rows."""
        height, width = self.pixels.shape[:2]
        colours = np.empty((height, width, 3), np.float32)
        for rows in row_slices(height, 4 * width):
            linear = np.maximum(self.pixels[rows], 0)
            colours[rows] = (srgb_to_linear(linear) if self.srgb else linear) * np.float32(self.strength)
            yield rows.stop / height
        if height > _ROWS:
            width = max(1, round(width * _ROWS / height))
            colours = yield from shrink_sky_in_slices(colours, _ROWS, width)
        return colours if self.turn is None else (yield from _turned(colours, self.turn))


def _environment(node: bpy.types.Node, owner: str, cache: PixelCache, strength: float) -> _Environment:
    """Return an environment texture with the rotation of its Mapping node."""
    if node.projection != "EQUIRECTANGULAR" or not is_plain(node.image):
        raise ComplexError
    turn = _rotation(node.inputs["Vector"])
    pixels = cache.read_part(node.image, owner, "colour * alpha")
    return _Environment(pixels, is_srgb(node.image), turn, strength)


def _rotation(socket: bpy.types.NodeSocket) -> np.ndarray | None:
    """Return the (3, 3) float64 matrix that Mapping nodes apply to directions; None without one."""
    output = feeding_socket(socket)
    if not output.is_output:
        return None
    node = output.node
    if node.bl_idname == "ShaderNodeTexCoord" and output.name == "Generated":
        return None
    if node.bl_idname != "ShaderNodeMapping" or node.vector_type not in {"POINT", "VECTOR"}:
        raise ComplexError
    names = ("Location", "Rotation", "Scale")
    if any(feeding_socket(node.inputs[name]).is_output for name in names):
        raise ComplexError
    if node.vector_type == "POINT" and any(
        abs(value) > 1e-6 for value in node.inputs["Location"].default_value
    ):
        raise ComplexError
    inner = _rotation(node.inputs["Vector"])
    turn = np.array(node.inputs["Rotation"].default_value.to_matrix(), np.float64)
    matrix = turn @ np.diag(np.array(node.inputs["Scale"].default_value, np.float64))
    return matrix if inner is None else matrix @ inner


def _turned(pixels: np.ndarray, matrix: np.ndarray) -> Slices[np.ndarray]:
    """Resample a map, (h, w, 3) float32, such that direction d gets the value at `matrix` @ d.

    Small maps grow to `_TURNED` rows and columns: their own pixels would blur the interpolated light. Each
    pixel is a mean over its area unless the rows stay: a sun of one pixel would gain or lose some percent.
    """
    height, width = pixels.shape[:2]
    lines, columns = height * -(-_TURNED[0] // height), width * -(-_TURNED[1] // width)
    across = 1 if _keeps_rows(matrix) else max(1, math.isqrt(_POINTS // (lines * columns)))
    turned = np.zeros((lines, columns, 3), np.float32)
    shifts = (np.arange(across) + 0.5) / across
    for rows in row_slices(lines, 20 * columns * across**2):
        theta = np.pi * (1 - (np.arange(rows.start, rows.stop)[:, None] + shifts).reshape(-1, 1) / lines)
        for shift in shifts:
            phi = 2 * np.pi * (0.5 - (np.arange(columns) + shift) / columns)
            points = _turned_points(theta, phi, matrix) * (width, height) - 0.5
            colours = _interpolated(pixels, points[..., 0], points[..., 1])
            turned[rows] += colours.reshape(-1, across, columns, 3).mean(axis=1) / across
        yield rows.stop / lines
    return turned


def _keeps_rows(matrix: np.ndarray) -> bool:
    """Return True if a matrix only rotates about z, which shifts the columns of a map."""
    return np.allclose(matrix @ matrix.T, np.eye(3), atol=1e-6) and abs(matrix[2, 2] - 1) < 1e-6


def _turned_points(theta: np.ndarray, phi: np.ndarray, matrix: np.ndarray) -> np.ndarray:
    """Return the points (u, v) of a map, (n, m, 2), in the turned directions of angles, (n, 1) and (m,)."""
    x, y = np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi)
    z = np.broadcast_to(np.cos(theta), x.shape)
    directions = np.stack([x, y, z], axis=2) @ matrix.T
    length = np.maximum(np.linalg.norm(directions, axis=2), 1e-30)
    u = 0.5 - np.arctan2(directions[..., 1], directions[..., 0]) / (2 * np.pi)
    v = 1 - np.arccos(np.clip(directions[..., 2] / length, -1, 1)) / np.pi
    return np.stack([u, v], axis=2)


def _interpolated(pixels: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return bilinearly interpolated pixels at positions in pixels from the first centre; columns wrap."""
    height, width = pixels.shape[:2]
    left, below = np.floor(x).astype(int), np.floor(y).astype(int)
    across, up = (x - left)[..., None].astype(np.float32), (y - below)[..., None].astype(np.float32)
    low, high = np.clip(below, 0, height - 1), np.clip(below + 1, 0, height - 1)
    first = pixels[low, left % width] * (1 - across) + pixels[low, (left + 1) % width] * across
    second = pixels[high, left % width] * (1 - across) + pixels[high, (left + 1) % width] * across
    return (first * (1 - up) + second * up).astype(np.float32)
