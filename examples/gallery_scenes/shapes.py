"""Materials, images and simple meshes of the gallery's scenes.

Lengths are in meters, angles in degrees, colors in linear Rec.709. Meshes get a UV layer "UVMap" for images.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import bmesh
import bpy
import numpy as np
from mathutils import Euler, Matrix, Vector

Color = tuple[float, float, float]
Point = tuple[float, float, float]


def material(
    name: str, color: Color = (0.8, 0.8, 0.8), image: bpy.types.Image | None = None, **inputs: object
):
    """Return a diffuse Principled material, or the one that has this name already.

    image:   base color in place of `color`; it repeats over the UVs
    inputs:  values of sockets by name, with _ for a blank
    """
    if name in bpy.data.materials:
        return bpy.data.materials[name]
    result = bpy.data.materials.new(name)
    if result.node_tree is None:
        result.use_nodes = True
    principled = result.node_tree.nodes["Principled BSDF"]
    values = {"Base Color": (*color, 1.0), "Roughness": 1.0, "Specular IOR Level": 0.0}
    values |= {key.replace("_", " "): value for key, value in inputs.items()}
    for socket, value in values.items():
        principled.inputs[socket].default_value = value
    if image is not None:
        _feed(result, "Base Color", image)
    result.diffuse_color = (*color, 1.0)
    return result


def _feed(surface: bpy.types.Material, socket: str, image: bpy.types.Image) -> None:
    """Link an image to a socket of the Principled BSDF."""
    tree = surface.node_tree
    texture = tree.nodes.new("ShaderNodeTexImage")
    texture.image = image
    tree.links.new(texture.outputs["Color"], tree.nodes["Principled BSDF"].inputs[socket])


def lamp_material(name: str, color: Color, radiance: float, image: bpy.types.Image | None = None):
    """Return a white material that emits, or the one that has this name already.

    image:  emitted color in place of `color`
    """
    known = name in bpy.data.materials
    result = material(name, Emission_Color=(*color, 1.0), Emission_Strength=radiance)
    if image is not None and not known:
        _feed(result, "Emission Color", image)
    return result


def cloth(name: str, color: Color, transmitted: float):
    """Return a material whose back shows `transmitted` of the light that its front reflects."""
    if name in bpy.data.materials:
        return bpy.data.materials[name]
    result = material(name, color)
    tree = result.node_tree
    translucent, mix = tree.nodes.new("ShaderNodeBsdfTranslucent"), tree.nodes.new("ShaderNodeMixShader")
    translucent.inputs["Color"].default_value = (*color, 1.0)
    mix.inputs[0].default_value = transmitted
    tree.links.new(tree.nodes["Principled BSDF"].outputs[0], mix.inputs[1])
    tree.links.new(translucent.outputs[0], mix.inputs[2])
    tree.links.new(mix.outputs[0], tree.nodes["Material Output"].inputs["Surface"])
    return result


def glass(name: str):
    """Return clear glass."""
    return material(name, (1, 1, 1), Transmission_Weight=1.0, Roughness=0.0, Specular_IOR_Level=0.5)


def painted(name: str, pixels: np.ndarray) -> bpy.types.Image:
    """Return an image of linear colors, packed as sRGB.

    pixels:  (h, w, 3), 0 to 1, bottom row first
    """
    height, width = pixels.shape[:2]
    image = bpy.data.images.new(name, width, height)
    pixels = np.clip(pixels, 0, 1)
    srgb = np.where(pixels < 0.0031308, 12.92 * pixels, 1.055 * pixels ** (1 / 2.4) - 0.055)
    rgba = np.concatenate([srgb, np.ones((height, width, 1))], axis=2)
    image.pixels.foreach_set(rgba.astype(np.float32).ravel())
    image.pack()
    return image


def add(
    name: str, surface: bpy.types.Material, vertices: Sequence, faces: Sequence,
    at: Point = (0, 0, 0), turn: Point = (0, 0, 0), uv: float = 1.0, smooth: bool = False,
):  # fmt: skip
    """Return a new mesh object of the scene.

    uv:      size of an image on the surface, m
    smooth:  True to interpolate normals
    """
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata([tuple(v) for v in vertices], [], faces)
    mesh.materials.append(surface)
    mesh.polygons.foreach_set("use_smooth", [smooth] * len(mesh.polygons))
    _project(mesh, uv)
    return place(name, mesh, at, turn)


def place(name: str, mesh: bpy.types.Mesh, at: Point, turn: Point = (0, 0, 0), scale: Point = (1, 1, 1)):
    """Return a new object that shows a mesh, which others may show as well."""
    result = bpy.data.objects.new(name, mesh)
    result.location, result.scale = at, scale
    result.rotation_euler = [math.radians(angle) for angle in turn]
    bpy.context.scene.collection.objects.link(result)
    return result


def _project(mesh: bpy.types.Mesh, size: float) -> None:
    """Give each face the UVs of a projection along the axis that is closest to its normal."""
    uvs = mesh.uv_layers.new(name="UVMap").uv
    for face in mesh.polygons:
        axis = max(range(3), key=lambda i: abs(face.normal[i]))
        u, v = ((1, 2), (0, 2), (0, 1))[axis]
        for loop in face.loop_indices:
            point = mesh.vertices[mesh.loops[loop].vertex_index].co
            uvs[loop].vector = (point[u] / size, point[v] / size)


def quad(name: str, surface: bpy.types.Material, corners: Sequence[Point], uv: float = 1.0):
    """Return a flat quadrilateral whose front shows the corners counter-clockwise."""
    return add(name, surface, corners, [(0, 1, 2, 3)], uv=uv)


def block(name: str, surface: bpy.types.Material, size: Point, at: Point, turn: Point = (0, 0, 0),
          bevel: float = 0.0, uv: float = 1.0):  # fmt: skip
    """Return a box whose bottom's middle is at `at`, with rounded edges of radius `bevel`."""
    solid = bmesh.new()
    bmesh.ops.create_cube(solid, size=1.0)
    move = Matrix.Translation((0, 0, size[2] / 2)) @ Matrix.Diagonal((*size, 1.0))
    bmesh.ops.transform(solid, matrix=move, verts=solid.verts)
    if bevel:
        bmesh.ops.bevel(solid, geom=solid.edges[:], offset=bevel, segments=2, affect="EDGES", profile=0.5)
    return _add_solid(name, surface, solid, at, turn, uv, smooth=False)


def cushion(
    name: str,
    surface: bpy.types.Material,
    size: Point,
    at: Point,
    turn: Point = (0, 0, 0),
    power: float = 4.0,
):
    """Return a superellipsoid, a soft box: larger powers are closer to a box."""
    solid = bmesh.new()
    bmesh.ops.create_uvsphere(solid, u_segments=32, v_segments=16, radius=1.0)
    for vertex in solid.verts:
        length = sum(abs(c) ** power for c in vertex.co) ** (1 / power)
        vertex.co = Vector([c / length * s / 2 for c, s in zip(vertex.co, size, strict=True)])
    return _add_solid(name, surface, solid, at, turn, 0.5, smooth=True)


def _add_solid(name, surface, solid: bmesh.types.BMesh, at: Point, turn: Point, uv: float, smooth: bool):
    solid.verts.index_update()
    vertices = [vertex.co.copy() for vertex in solid.verts]
    faces = [[vertex.index for vertex in face.verts] for face in solid.faces]
    solid.free()
    return add(name, surface, vertices, faces, at, turn, uv=uv, smooth=smooth)


def lathe(name: str, surface: bpy.types.Material, profile: Sequence[tuple[float, float]], at: Point,
          turn: Point = (0, 0, 0), segments: int = 24):  # fmt: skip
    """Return a surface of revolution around z; the profile lists radius and height from bottom to top.

    A profile that begins or ends at radius 0 is closed there.
    """
    angles = [2 * math.pi * i / segments for i in range(segments)]
    rings = [(r, z) for r, z in profile]
    vertices = [(r * math.cos(a), r * math.sin(a), z) for r, z in rings for a in angles]
    faces = []
    for ring in range(len(rings) - 1):
        low, high = ring * segments, (ring + 1) * segments
        faces += [
            (low + i, low + (i + 1) % segments, high + (i + 1) % segments, high + i) for i in range(segments)
        ]
    solid = bmesh.new()
    points = [solid.verts.new(vertex) for vertex in vertices]
    for face in faces:
        solid.faces.new([points[i] for i in face])
    bmesh.ops.remove_doubles(solid, verts=solid.verts, dist=1e-6)
    bmesh.ops.dissolve_degenerate(solid, edges=solid.edges, dist=1e-6)
    return _add_solid(name, surface, solid, at, turn, 1.0, smooth=True)


def sheet(
    name: str, surface: bpy.types.Material, point: Callable[[float, float], Point], columns: int, rows: int,
    at: Point = (0, 0, 0), turn: Point = (0, 0, 0),
):  # fmt: skip
    """Return a curved surface over the unit square.

    point:  maps (u, v) of the unit square to a position
    """
    vertices = [point(u / columns, v / rows) for v in range(rows + 1) for u in range(columns + 1)]
    step = columns + 1
    corners = [v * step + u for v in range(rows) for u in range(columns)]
    faces = [(i, i + 1, i + step + 1, i + step) for i in corners]
    return add(name, surface, vertices, faces, at, turn, smooth=True)


def camera(at: Point, target: Point, lens: float) -> bpy.types.Object:
    """Return the scene's camera, which looks at a target; lens: focal length, mm."""
    data = bpy.data.cameras.new("Camera")
    data.lens, data.clip_start = lens, 0.05
    result = place("Camera", data, at)
    result.rotation_euler = _toward(Vector(target) - Vector(at))
    bpy.context.scene.camera = result
    return result


def sun(direction: Point, irradiance: float, color: Color, angle: float = 0.53) -> bpy.types.Object:
    """Return a sun; direction: of its light, irradiance: W/m², angle: of its disc, degrees."""
    data = bpy.data.lights.new("Sun", "SUN")
    data.energy, data.color, data.angle = irradiance, color, math.radians(angle)
    result = place("Sun", data, (0, 0, 5))
    result.rotation_euler = _toward(Vector(direction))
    return result


def sky(color: Color, strength: float) -> None:
    """Give the scene a world of one color."""
    scene = bpy.context.scene
    scene.world = bpy.data.worlds.new("Sky")
    if scene.world.node_tree is None:
        scene.world.use_nodes = True
    background = scene.world.node_tree.nodes["Background"]
    background.inputs["Color"].default_value, background.inputs["Strength"].default_value = (
        (*color, 1),
        strength,
    )


def _toward(direction: Vector) -> Euler:
    """Return the rotation that turns -z to a direction and keeps y up."""
    return direction.to_track_quat("-Z", "Y").to_euler()


def noise(seed: int, size: int, octaves: int, stretch: int = 1) -> np.ndarray:
    """Return a tileable sum of random grids, interpolated by cosines, (size, size), mean 0, within ±1.

    stretch:  factor by which features are longer along x
    """
    random, result, total = np.random.default_rng(seed), np.zeros((size, size)), 0.0
    for octave in range(octaves):
        rows, columns = 4 << octave, max(1, (4 << octave) // stretch)
        grid, weight = random.uniform(-1, 1, (rows, columns)), 0.5**octave
        result += weight * _enlarge(_enlarge(grid, size).T, size).T
        total += weight
    return result / total


def _enlarge(grid: np.ndarray, size: int) -> np.ndarray:
    """Interpolate periodic rows, (n, m), to (size, m)."""
    place = np.arange(size) * len(grid) / size
    low, part = np.floor(place).astype(int), place % 1
    weight = (0.5 - 0.5 * np.cos(np.pi * part))[:, None]
    return grid[low] * (1 - weight) + grid[(low + 1) % len(grid)] * weight
