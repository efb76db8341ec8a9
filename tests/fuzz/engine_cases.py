"""Random scenes and settings for the engine: descriptions that print as they are written."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from hypothesis import strategies as st

from engine import Light, Material, Mesh, Scene, Settings, Texture
from engine.scene.model import LIGHT_KINDS, NO_LIGHTMAP
from tests.analytic.scenes import material, quads, room_walls
from tests.transparency import clear_back, transparent

Vector = tuple[float, float, float]

#: Where a closed room with radiosity known beforehand stands, and its size, in extents of the scene.
_AWAY, _ROOM = 4.0, 1.0


@dataclass(frozen=True)
class Shape:
    """A mesh.

    kind:   one of SHAPES
    count:  of its parts, for kinds that have any number
    uvs:    one of UVS
    turn:   seed of a rotation, 0 for none
    """

    kind: str = "quad"
    count: int = 3
    size: float = 1.0
    stretch: Vector = (1.0, 1.0, 1.0)
    position: Vector = (0.0, 0.0, 0.0)
    turn: int = 0
    uvs: str = "grid"
    atlas: int = 0
    material: int = 0
    smooth: bool = False
    texture_scale: float = 1.0


@dataclass(frozen=True)
class Map:
    """A texture of random pixels in [0, 1] times `brightest`."""

    height: int = 4
    width: int = 4
    extension: str = "repeat"
    smooth: bool = True
    srgb: bool = False
    uv_map: str = "UVMap"
    transform: tuple[float, ...] = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0)
    brightest: float = 1.0


@dataclass(frozen=True)
class Surface:
    """A material."""

    reflectance: Vector = (0.5, 0.5, 0.5)
    emission: Vector = (0.0, 0.0, 0.0)
    alpha: float = 1.0
    alpha_threshold: float | None = None
    clear_back: bool = False
    reflectance_map: Map | None = None
    emission_map: Map | None = None
    alpha_map: Map | None = None


@dataclass(frozen=True)
class Lamp:
    """A light; `turn` is the seed of its rotation."""

    kind: str = "point"
    position: Vector = (0.0, 0.0, 1.0)
    turn: int = 0
    strength: Vector = (1.0, 1.0, 1.0)
    radius: float = 0.0
    soft: bool = True
    half_angle: float = 0.5
    blend: float = 0.0
    stretch: Vector = (1.0, 1.0, 1.0)
    size: tuple[float, float] = (1.0, 1.0)
    ellipse: bool = False
    casts_shadow: bool = True


@dataclass(frozen=True)
class Sky:
    """The world: a colour, or a map of rows x columns with a spot that is brighter by a factor."""

    colour: Vector = (0.0, 0.0, 0.0)
    rows: int = 0
    columns: int = 0
    spot: float = 1.0


@dataclass(frozen=True)
class Case:
    """A bake.

    scale:   of everything, m
    away:    distance of the scene from the origin in its own sizes
    room:    reflectance of a closed room that stands apart, or None
    spoil:   name of one of SPOILS, what is wrong with the scene or the settings, or None
    cancel:  slice after which the bake is cancelled, or None
    other:   settings with which the same scene is baked again for comparison, or None
    damage:  keeps the patch list in a file, in which the byte of this number (modulo the size) is changed
             before the scene is baked again; -1 for none, None for no file
    """

    shapes: tuple[Shape, ...] = (Shape(),)
    surfaces: tuple[Surface, ...] = (Surface(),)
    lamps: tuple[Lamp, ...] = ()
    sky: Sky = Sky()
    scale: float = 1.0
    away: float = 0.0
    atlases: int = 1
    room: float | None = None
    settings: dict[str, Any] = field(default_factory=dict)
    spoil: str | None = None
    cancel: int | None = None
    other: dict[str, Any] | None = None
    damage: int | None = None


# Shapes: (t, 3, 3) corners in a box of about [0, 1], and the polygon of each triangle.


def _polygons(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the triangles of quads, (q, 4, 3)."""
    triangles = np.asarray(corners, float)[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3, 3)
    return triangles, np.repeat(np.arange(len(corners)), 2)


def _triangles(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return np.asarray(corners, float).reshape(-1, 3, 3), np.arange(len(corners))


_SQUARE = np.array([[(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]], float)


def _floor(count: int) -> np.ndarray:
    """Return count x count squares that make one."""
    steps = np.stack(np.meshgrid(np.arange(count), np.arange(count), [0], indexing="ij"), axis=-1)
    return (_SQUARE[0] + steps.reshape(-1, 1, 3)) / (count, count, 1)


def _ball(count: int) -> np.ndarray:
    """Return a ball of count + 2 rows of twice as many quads."""
    rows = count + 2
    theta, phi = np.linspace(0, np.pi, rows + 1), np.linspace(0, 2 * np.pi, 2 * rows + 1)
    points = np.stack(
        [
            np.outer(np.sin(theta), np.cos(phi)),
            np.outer(np.sin(theta), np.sin(phi)),
            np.outer(-np.cos(theta), np.ones_like(phi)),
        ],
        axis=-1,
    )
    corners = [points[:-1, :-1], points[:-1, 1:], points[1:, 1:], points[1:, :-1]]
    return np.stack(corners, axis=2).reshape(-1, 4, 3) / 2 + 0.5


def _cube() -> np.ndarray:
    return room_walls(1, 1, 1)[:, ::-1]


SHAPES: dict[str, Callable[[int], tuple[np.ndarray, np.ndarray]]] = {
    "quad": lambda count: _polygons(_SQUARE),
    "cube": lambda count: _polygons(_cube()),
    "room": lambda count: _polygons(room_walls(1, 1, 1)),
    "floor": lambda count: _polygons(_floor(count)),
    "ball": lambda count: _polygons(_ball(count)),
    "cubes": lambda count: _polygons(
        np.concatenate([_cube() / count + (index / count, 0, 0) for index in range(count)])
    ),
    "foot": lambda count: _polygons(np.concatenate([_SQUARE, _cube() / 3 + (1 / 3, 1 / 3, 0)])),
    "doubled": lambda count: _polygons(np.repeat(_SQUARE, count, axis=0)),
    "two sides": lambda count: _polygons(np.concatenate([_SQUARE, _SQUARE[:, ::-1]])),
    "soup": lambda count: _triangles(np.random.default_rng(count).random((count, 3, 3))),
    "needle": lambda count: _triangles([[(0, 0, 0), (1, 0, 0), (0.5, 10.0**-count, 0)]]),
    "point": lambda count: _triangles(np.zeros((1, 3, 3))),
    "nothing": lambda count: _triangles(np.zeros((0, 3, 3))),
}


def _cells(face: np.ndarray, margin: float) -> np.ndarray:
    """Return lightmap UVs that give each polygon a cell of its own, (t, 3, 2)."""
    columns = int(np.ceil(np.sqrt(face.max(initial=0) + 1)))
    second = np.r_[False, face[1:] == face[:-1]][: len(face)]
    first, other = [(0, 0), (1, 0), (1, 1)], [(0, 0), (1, 1), (0, 1)]
    inside = np.where(second[:, None, None], other, first) * (1 - 2 * margin) + margin
    corner = np.stack([face % columns, face // columns], axis=1)[:, None]
    return (inside + corner) / columns


UVS: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "grid": lambda face: _cells(face, 0.1),
    "tight": lambda face: _cells(face, 0.0),
    "whole": lambda face: _cells(face * 0, 0.0),
    "flat": lambda face: _cells(face, 0.1) * (1, 0),
    "one point": lambda face: np.full((len(face), 3, 2), 0.5),
    "tiny": lambda face: _cells(face, 0.1) * 1e-3 + 0.4,
    "random": lambda face: np.random.default_rng(len(face)).random((len(face), 3, 2)),
}


def _rotation(seed: int) -> np.ndarray:
    """Return a random rotation, (3, 3); none for seed 0."""
    if seed == 0:
        return np.eye(3)
    axes, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    return axes * np.linalg.det(axes)


def _mesh(shape: Shape, name: str, case: Case, strip: tuple[int, int]) -> Mesh:
    corners, face = SHAPES[shape.kind](shape.count)
    corners = (corners * shape.stretch * shape.size) @ _rotation(shape.turn).T + shape.position
    positions = ((corners + case.away) * case.scale).astype(np.float32)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, None] + np.zeros(
        (3, 1)
    )
    if shape.smooth:
        normals = corners - corners.reshape(-1, 3).mean(axis=0) if len(corners) else normals
    length = np.linalg.norm(normals, axis=2, keepdims=True)
    uvs = UVS[shape.uvs](face)
    number, count = strip
    texture_uvs = np.random.default_rng(len(face)).random((len(face), 3, 2)) * shape.texture_scale
    return Mesh(
        name=name,
        positions=positions,
        normals=np.where(length > 0, normals / np.where(length > 0, length, 1), (0, 0, 1)).astype(np.float32),
        uvs=((uvs + np.array([0, number])) / (1, count)).astype(np.float32),
        face=face.astype(np.int32),
        subface=np.r_[0, np.diff(face) == 0].astype(np.int32)[: len(face)],
        material=np.full(len(face), min(shape.material, len(case.surfaces) - 1), np.int32),
        atlas=min(shape.atlas, case.atlases - 1),
        texture_uvs={"UVMap": texture_uvs.astype(np.float32)},
    )


def _texture(image: Map | None, name: str, channels: int) -> Texture | None:
    if image is None:
        return None
    random = np.random.default_rng(image.height * 1000 + image.width)
    pixels = random.random((image.height, image.width, channels), np.float32) * np.float32(image.brightest)
    transform = np.array(image.transform).reshape(2, 3)
    return Texture(
        name, pixels, image.uv_map, transform, image.extension, image.smooth, image.srgb and channels == 3
    )


def _material(surface: Surface, name: str) -> Material:
    holes = _texture(surface.alpha_map, f"{name} alpha", 1)
    material = Material(
        name,
        np.array(surface.reflectance, np.float32),
        np.array(surface.emission, np.float32),
        _texture(surface.reflectance_map, f"{name} reflectance", 3),
        _texture(surface.emission_map, f"{name} emission", 3),
        transmission=transparent(surface.alpha, holes, surface.alpha_threshold),
    )
    return clear_back(material) if surface.clear_back else material


def _light(lamp: Lamp, name: str, case: Case) -> Light:
    """Return a light that is as bright whatever the scale: an intensity falls with the square of distance."""
    factor = case.scale**2 if lamp.kind in {"point", "spot"} else 1.0
    return Light(
        name=name,
        kind=lamp.kind,
        position=(np.array(lamp.position) + case.away) * case.scale,
        axes=_rotation(lamp.turn),
        strength=(np.array(lamp.strength) * factor).astype(np.float32),
        radius=lamp.radius * case.scale,
        soft=lamp.soft,
        half_angle=lamp.half_angle,
        blend=lamp.blend,
        stretch=np.array(lamp.stretch),
        size=np.array(lamp.size) * case.scale,
        ellipse=lamp.ellipse,
        casts_shadow=lamp.casts_shadow,
    )


def _world(sky: Sky) -> np.ndarray:
    colour = np.array(sky.colour, np.float32)
    if not sky.rows:
        return colour
    random = np.random.default_rng(sky.rows)
    pixels = random.random((sky.rows, sky.columns, 1), np.float32) * colour
    pixels[2 * sky.rows // 3, sky.columns // 2] *= np.float32(sky.spot)
    return pixels


def _extent(case: Case, meshes: list[Mesh], lights: tuple[Light, ...]) -> float:
    """Return the largest distance of meshes and lamps from the middle of a case, along any axis."""
    middle = case.away * case.scale
    reach = [np.abs(mesh.positions - middle).max(initial=0) for mesh in meshes]
    reach += [
        np.abs(light.position - middle).max() + max(light.radius, *light.size) * max(1, light.stretch.max())
        for light in lights
    ]
    return float(max(reach, default=0)) or case.scale


def _known_room(case: Case, extent: float) -> tuple[Mesh, Material]:
    """Return a closed room of radiance 1 apart from all else."""
    resolution = Settings(**case.settings).resolution
    side = resolution // 3 - 2
    charts = [((side + 2) * (i % 3), (side + 2) * (i // 3), side, side) for i in range(6)]
    walls = (room_walls(1, 1, 1) * _ROOM + _AWAY) * extent + case.away * case.scale
    mesh = quads(walls, charts, [len(case.surfaces)] * 6, resolution, "Known room")
    return replace(mesh, atlas=case.atlases), material("Known", case.room, 1.0)


def build(case: Case) -> tuple[Scene, Settings]:
    """Return the scene and the settings of a case."""
    seats = [min(shape.atlas, case.atlases - 1) for shape in case.shapes]
    meshes = [
        _mesh(shape, f"Shape {i}", case, (seats[:i].count(seat), seats.count(seat)))
        for i, (shape, seat) in enumerate(zip(case.shapes, seats, strict=True))
    ]
    materials = [_material(surface, f"Surface {i}") for i, surface in enumerate(case.surfaces)]
    lights = tuple(_light(lamp, f"Lamp {i}", case) for i, lamp in enumerate(case.lamps))
    atlases = [f"Atlas {i}" for i in range(case.atlases)]
    if case.room is not None:
        mesh, surface = _known_room(case, _extent(case, meshes, lights))
        meshes.append(mesh)
        materials.append(surface)
        atlases.append("Known")
    scene = Scene(
        meshes=tuple(meshes),
        materials=tuple(materials),
        atlases=tuple(atlases),
        world=_world(case.sky),
        lights=lights,
    )
    settings = Settings(**case.settings)
    return (scene, settings) if case.spoil is None else SPOILS[case.spoil](scene, settings)


# What can be wrong: each has to be refused.


def _array(name: str, value: Any) -> Callable[[Scene, Settings], tuple[Scene, Settings]]:
    """Return a spoil that sets the first number of an array of the first mesh."""

    def spoil(scene: Scene, settings: Settings) -> tuple[Scene, Settings]:
        mesh = scene.meshes[0]
        values = getattr(mesh, name).copy()
        values.reshape(-1)[0] = value
        changed = replace(mesh, **{name: values})
        return replace(scene, meshes=(changed, *scene.meshes[1:])), settings

    return spoil


def _field(part: str, **values: Any) -> Callable[[Scene, Settings], tuple[Scene, Settings]]:
    """Return a spoil that sets fields of the first mesh, material or light."""

    def spoil(scene: Scene, settings: Settings) -> tuple[Scene, Settings]:
        first, *others = getattr(scene, part)
        return replace(scene, **{part: (replace(first, **values), *others)}), settings

    return spoil


def _setting(**values: Any) -> Callable[[Scene, Settings], tuple[Scene, Settings]]:
    return lambda scene, settings: (scene, replace(settings, **values))


def _sky(pixels: np.ndarray) -> Callable[[Scene, Settings], tuple[Scene, Settings]]:
    return lambda scene, settings: (replace(scene, world=pixels), settings)


_EMPTY = Texture("Empty", np.zeros((0, 5, 3), np.float32), "UVMap")

#: Each needs a first shape with faces that is baked, a first surface, a first lamp.
SPOILS: dict[str, Callable[[Scene, Settings], tuple[Scene, Settings]]] = {
    "NaN position": _array("positions", np.nan),
    "infinite position": _array("positions", np.inf),
    "NaN normal": _array("normals", np.nan),
    "infinite normal": _array("normals", -np.inf),
    "NaN UV": _array("uvs", np.nan),
    "infinite UV": _array("uvs", np.inf),
    "UV outside": _array("uvs", 1.5),
    "material too large": _array("material", 1000),
    "material negative": _array("material", -1),
    "faces unordered": _array("face", 1 << 20),
    "atlas too large": _field("meshes", atlas=1000),
    "atlas negative": _field("meshes", atlas=-2),
    "reflectance 2": _field("materials", reflectance=np.full(3, 2, np.float32)),
    "reflectance NaN": _field("materials", reflectance=np.full(3, np.nan, np.float32)),
    "emission negative": _field("materials", emission=np.full(3, -1, np.float32)),
    "emission infinite": _field("materials", emission=np.full(3, np.inf, np.float32)),
    "alpha 3": _field("materials", transmission=transparent(3.0)),
    "empty texture": _field("materials", reflectance_map=_EMPTY),
    "unknown light": _field("lights", kind="candle"),
    "light NaN": _field("lights", strength=np.full(3, np.nan, np.float32)),
    "light negative": _field("lights", strength=np.full(3, -1, np.float32)),
    "light nowhere": _field("lights", position=np.full(3, np.inf)),
    "light radius NaN": _field("lights", radius=np.nan),
    "sky NaN": _sky(np.full(3, np.nan, np.float32)),
    "sky negative": _sky(np.full((4, 8, 3), -1, np.float32)),
    "sky empty": _sky(np.zeros((0, 8, 3), np.float32)),
    "no meshes": lambda scene, settings: (replace(scene, meshes=()), settings),
    "resolution 7": _setting(resolution=7),
    "resolution huge": _setting(resolution=1 << 20),
    "hemicube 3": _setting(hemicube=3),
    "iterations 0": _setting(max_bounces=0),
    "tolerance NaN": _setting(tolerance=np.nan),
    "samples 3": _setting(samples=3),
    "samples -1": _setting(samples=-1),
    "light samples 0": _setting(light_samples=0),
    "method unknown": _setting(method="guess"),
    "visibility unknown": _setting(visibility="guess"),
    "outputs none": _setting(outputs=()),
    "outputs unknown": _setting(outputs=("heat",)),
    "outputs doubled": _setting(outputs=("direct", "direct")),
    "seed negative": _setting(seed=-1),
    "AO distance NaN": _setting(ao_distance=np.nan),
}


# Strategies: mostly of ordinary size, now and then of any.


def _among(ordinary: list, odd: list) -> st.SearchStrategy:
    """Return values of which one in eight is odd."""
    return st.integers(0, 7).flatmap(lambda dice: st.sampled_from(odd if dice == 7 else ordinary))


def _triple(numbers: st.SearchStrategy[float]) -> st.SearchStrategy[Vector]:
    return st.one_of(numbers.map(lambda value: (value,) * 3), st.tuples(numbers, numbers, numbers))


_FRACTION = _among([0.0, 0.2, 0.5, 0.8], [1.0, 1e-6, 0.999])
_LENGTH = _among([0.1, 0.5, 1.0, 2.0], [0.0, 1e-7, 1e-3, 100.0, 1e5])
_SCALE = _among([1.0, 0.5, 3.0], [1e-3, 1e-4, 1e-6, 1e-8, 1e3, 1e5, 1e8])
_POSITION = _triple(_among([0.0, 0.5, 1.0, -1.0, 0.3], [1e-7, 10.0, -1000.0, 1e5]))
_LIGHT = _among([0.0, 0.5, 1.0, 10.0], [1e-20, 1e-6, 1e6, 1e20, 1e30])

_MAPS = st.builds(
    Map,
    height=_among([1, 2, 3, 8, 17], [64, 301]),
    width=_among([1, 2, 3, 8, 17], [64, 301]),
    extension=st.sampled_from(["repeat", "mirror", "extend", "clip"]),
    smooth=st.booleans(),
    srgb=st.booleans(),
    transform=st.sampled_from(
        [
            (1.0, 0.0, 0.0, 0.0, 1.0, 0.0),
            (0.0,) * 6,
            (-3.0, 1.0, 0.5, 0.2, 7.0, -9.0),
            (1e8, 0.0, 0.0, 0.0, -1e8, 1e9),
        ]
    ),
)
_LIT_MAPS = st.builds(
    replace, _MAPS, srgb=st.just(False), brightest=_among([0.0, 1.0, 30.0], [1e6, 1e15, 1e30])
)


def _sometimes(strategy: st.SearchStrategy) -> st.SearchStrategy:
    """Return None three times out of four."""
    return st.one_of(st.none(), st.none(), st.none(), strategy)


_SURFACES = st.builds(
    Surface,
    reflectance=_triple(_FRACTION),
    emission=st.one_of(st.just((0.0, 0.0, 0.0)), _triple(_LIGHT)),
    alpha=st.one_of(st.just(1.0), _FRACTION),
    alpha_threshold=_sometimes(_FRACTION),
    clear_back=st.booleans(),
    reflectance_map=_sometimes(_MAPS),
    emission_map=_sometimes(_LIT_MAPS),
    alpha_map=_sometimes(_MAPS),
)

_SHAPES = st.builds(
    Shape,
    kind=_among([kind for kind in SHAPES if kind not in {"point", "nothing"}], ["point", "nothing"]),
    count=st.integers(1, 9),
    size=_LENGTH,
    stretch=st.one_of(st.just((1.0, 1.0, 1.0)), _triple(_LENGTH)),
    position=_POSITION,
    turn=st.integers(0, 3),
    uvs=_among(["grid", "grid", "tight"], list(UVS)),
    atlas=st.sampled_from([0, 0, 1, 2, NO_LIGHTMAP]),
    material=st.integers(0, 3),
    smooth=st.booleans(),
    texture_scale=_among([1.0, 3.0], [0.0, 1e3, 1e8, -1e12, 1e30]),
)

_LAMPS = st.builds(
    Lamp,
    kind=st.sampled_from(LIGHT_KINDS),
    position=_POSITION,
    turn=st.integers(0, 3),
    strength=_triple(_LIGHT),
    radius=_LENGTH,
    soft=st.booleans(),
    half_angle=_among([0.3, 0.8], [0.0, 1e-6, float(np.pi / 2)]),
    blend=_FRACTION,
    stretch=st.one_of(st.just((1.0, 1.0, 1.0)), _triple(_among([0.5, 1.0], [1e-6]))),
    size=st.tuples(_LENGTH, _LENGTH),
    ellipse=st.booleans(),
    casts_shadow=st.booleans(),
)

_SKIES = st.builds(
    Sky,
    colour=st.one_of(st.just((0.0, 0.0, 0.0)), _triple(_LIGHT)),
    rows=_among([0, 0, 1, 4, 9], [300, 101, 1021]),
    columns=_among([1, 2, 8, 17], [601, 203, 2042]),
    spot=_among([1.0, 100.0], [0.0, 1e6]),
)

_SETTINGS = st.fixed_dictionaries(
    {
        "resolution": st.integers(8, 24),
        "hemicube": st.sampled_from([8, 8, 16, 32]),
        "max_bounces": st.integers(1, 6),
        "light_samples": st.integers(1, 8),
        "ao_samples": st.integers(1, 8),
    },
    optional={
        "tolerance": st.sampled_from([0.0, 0.01, 1.0]),
        "method": st.sampled_from(["auto", "cached", "stream", "paper"]),
        "visibility": st.sampled_from(["auto", "raster", "rays"]),
        "samples": st.sampled_from([0, 4, 5, 16, 61, 64]),
        "directions": st.sampled_from(["cosine", "hemicube"]),
        "patch_groups": st.sampled_from([0, 1, 2, 4, 8]),
        "half_radiance": st.booleans(),
        "align_uvs": st.booleans(),
        "accelerate": st.booleans(),
        "memory_budget": st.sampled_from([0, 1, 10_000, 1_000_000]),
        "intermediates": st.booleans(),
        "centres": st.booleans(),
        "outputs": st.lists(
            st.sampled_from(["combined", "direct", "indirect", "ambient_occlusion"]), min_size=1, unique=True
        ).map(tuple),
        "sample_emission": st.booleans(),
        "ao_distance": st.sampled_from([0.0, 0.1, 1e9]),
        "seed": st.sampled_from([0, 1, (1 << 32) - 1]),
        "rotate": st.booleans(),
        "array_size": _among([(0, 0, 0)], [(64, 32, 1), (97, 53, 3), (16, 8, 1)]),
        "batch_bytes": st.sampled_from([1, 5_000, 1 << 20]),
        "margin": st.sampled_from([0, 1, 5, 256]),
        "hide_seams": st.booleans(),
        "texel_samples": st.sampled_from([1, 4, 16]),
    },
)

_BAKES = st.builds(
    Case,
    shapes=st.lists(_SHAPES, min_size=1, max_size=4).map(tuple),
    surfaces=st.lists(_SURFACES, min_size=1, max_size=3).map(tuple),
    lamps=st.lists(_LAMPS, max_size=3).map(tuple),
    sky=_SKIES,
    scale=_SCALE,
    away=_among([0.0, 3.0], [1e3, 1e5]),
    atlases=st.integers(1, 3),
    settings=_SETTINGS,
)


def _again(case: Case) -> st.SearchStrategy[Case]:
    """Return a bake that is compared with another way to bake it, with samples enough to be alike."""
    ways = [
        {"visibility": "raster", "method": "cached"},
        {"visibility": "rays", "method": "cached"},
        {"visibility": "rays", "method": "stream", "directions": "hemicube"},
        {"visibility": "raster", "method": "paper"},
    ]
    fixed = {**case.settings, "hemicube": 32, "light_samples": 64, "accelerate": False, "tolerance": 0.0}
    changing = ("samples", "outputs", "memory_budget", "patch_groups", "half_radiance", "array_size")
    for name in (*changing, "texel_samples"):
        fixed.pop(name, None)

    # Far from the middle, and on slivers, float32 has few digits, which each way spends differently; a point
    # of no extent on an edge, and a texture read on the border of texels, see one side as well as the other.
    shapes = tuple(
        replace(
            shape,
            position=tuple(np.clip(shape.position, -10, 10)),
            size=max(shape.size, 0.1),
            stretch=tuple(np.clip(shape.stretch, 0.1, 10)),
        )
        for shape in case.shapes
    )
    surfaces = tuple(
        replace(surface, alpha_map=surface.alpha_map and replace(surface.alpha_map, smooth=True))
        for surface in case.surfaces
    )
    near = replace(case, shapes=shapes, surfaces=surfaces, away=min(case.away, 3.0))
    return st.lists(st.sampled_from(ways), min_size=2, max_size=2, unique_by=str).map(
        lambda pair: replace(near, settings={**fixed, **pair[0]}, other={**fixed, **pair[1]})
    )


def _with_room(case: Case) -> st.SearchStrategy[Case]:
    """Return a bake with a room of known radiosity: all that shines through walls is left out."""
    lamps = tuple(replace(lamp, casts_shadow=True, strength=_dim(lamp.strength)) for lamp in case.lamps)
    surfaces = tuple(
        replace(surface, emission=_dim(surface.emission), emission_map=None) for surface in case.surfaces
    )
    sky = replace(case.sky, colour=_dim(case.sky.colour), spot=min(case.sky.spot, 100.0))
    settings = {**case.settings, "max_bounces": 20, "tolerance": 0.0, "light_samples": 64}
    settings["resolution"] = max(12, settings["resolution"])
    settings.pop("outputs", None)
    settings.pop("batch_bytes", None)
    return st.sampled_from([0.2, 0.6]).map(
        lambda room: replace(case, surfaces=surfaces, lamps=lamps, sky=sky, settings=settings, room=room)
    )


def _dim(light: Vector) -> Vector:
    """Return light that does not drown the room's in what float32 rounds off."""
    return tuple(min(value, 100.0) for value in light)


def _spoilt(case: Case) -> st.SearchStrategy[Case]:
    """Return a bake that has to be refused."""
    shapes = (Shape(), *case.shapes)
    return st.sampled_from(list(SPOILS)).map(
        lambda spoil: replace(
            case, shapes=shapes, lamps=(Lamp(), *case.lamps), scale=1.0, away=0.0, spoil=spoil
        )
    )


def _kept(case: Case) -> st.SearchStrategy[Case]:
    """Return a bake whose patch list is kept in a file, which may be damaged."""
    return st.integers(-1, 5000).map(lambda damage: replace(case, damage=damage))


def _cancelled(case: Case) -> st.SearchStrategy[Case]:
    return st.integers(0, 12).map(lambda number: replace(case, cancel=number))


#: Kinds of cases, and how many of twelve are of each.
_ENDS = {_cancelled: 1, _spoilt: 1, _kept: 1, _again: 2, _with_room: 3, st.just: 4}

CASES: st.SearchStrategy[Case] = st.sampled_from(
    [end for end, count in _ENDS.items() for _ in range(count)]
).flatmap(_BAKES.flatmap)

_SMALL = {"resolution": 16, "hemicube": 8, "max_bounces": 2, "light_samples": 4, "ao_samples": 4}
_RASTER, _RAYS = ({"visibility": way, "method": "cached", "hemicube": 32} for way in ("raster", "rays"))
_WHITE = Sky((1.0, 1.0, 1.0))
_CUTOUT = Surface(alpha_map=Map(4096, 4096))

#: What once went wrong, by what went wrong.
EXAMPLES: dict[str, Case] = {
    **{f"spoilt: {name}": Case(lamps=(Lamp(),), settings=_SMALL, spoil=name) for name in SPOILS},
    **{
        f"sky of {rows} x {columns}": Case(sky=Sky((1.0, 1.0, 1.0), rows, columns, 100.0), settings=_SMALL)
        for rows, columns in [(768, 1366), (300, 601), (1000, 1999), (1021, 2042), (1, 1), (1, 2042)]
    },
    "700 occluder boxes": Case(
        (Shape(), Shape("cubes", 700, size=9.0, atlas=NO_LIGHTMAP)),
        sky=_WHITE,
        settings={**_SMALL, "resolution": 64},
    ),
    "four alpha maps of 4096 x 4096": Case(
        tuple(Shape("quad", position=(0.0, 0.0, float(i)), material=i) for i in range(4)),
        tuple(_CUTOUT for _ in range(4)),
        sky=_WHITE,
        settings={**_SMALL, **_RASTER},
        other={**_SMALL, **_RAYS},
    ),
    "a foot on a floor": Case(
        (Shape("foot"),), sky=_WHITE, settings={**_SMALL, **_RASTER}, other={**_SMALL, **_RAYS}
    ),
    "inside of a hard lamp": Case(
        lamps=(Lamp(position=(0.5, 0.5, 0.0), radius=2.0, soft=False),), settings=_SMALL
    ),
    "odd texture": Case(
        surfaces=(Surface(emission=(1.0, 1.0, 1.0), emission_map=Map(301, 203)),), settings=_SMALL
    ),
    "eight atlases": Case(
        tuple(Shape(position=(float(i), 0.0, 0.0), atlas=i) for i in range(8)),
        atlases=8,
        sky=_WHITE,
        settings=_SMALL,
    ),
    **{
        f"patch file, byte {byte}": Case(sky=_WHITE, settings=_SMALL, damage=byte)
        for byte in (-1, 0, 9, 40, 100, 300, 1000)
    },
    "lamps scaled to 0": Case(
        lamps=(Lamp("spot", stretch=(0.0, 0.0, 0.0)), Lamp("area", size=(0.0, 0.0))), settings=_SMALL
    ),
    "a tiny scene under a wide ellipse": Case(
        (Shape("floor"),),
        lamps=(
            Lamp("area", size=(3e6, 3e6), ellipse=True),
            Lamp("area", turn=1, size=(3e6, 1.0), ellipse=True),
        ),
        scale=3e-6,
        settings=_SMALL,
    ),
    **{
        f"texture coordinates of {scale:g}, {way}": Case(
            (Shape(texture_scale=scale),),
            (Surface(reflectance_map=Map(), alpha_map=Map(3, 5)),),
            sky=_WHITE,
            settings={**_SMALL, "outputs": ("combined", "ambient_occlusion"), "visibility": way},
        )
        for scale in (1e8, -1e12, 1e30)
        for way in ("raster", "rays")
    },
    **{
        f"{outputs[0]}, {way}, {method}": Case(
            (Shape("floor"),),
            lamps=(Lamp("area", size=(3e6, 1.0)), Lamp("sun")),
            sky=_WHITE,
            room=0.5,
            settings={
                **_SMALL,
                "outputs": ("combined", *outputs),
                "visibility": way,
                "method": method,
            },
        )
        for outputs in (("directional", "dominant_direction"), ("spherical_harmonics",))
        for way in ("raster", "rays")
        for method in ("cached", "stream")
    },
    **{
        f"a room of {scale:g} m": Case(
            scale=scale, room=0.5, settings={**_SMALL, "max_bounces": 20, "tolerance": 0.0}
        )
        for scale in (1e-12, 1e-10, 1e-8, 1e-5, 1e5, 1e8, 1e10, 1e15)
    },
    "a lamp beside meshes that are small": Case(
        (Shape("quad", size=0.1),),
        lamps=(Lamp(position=(0.3, 0.3, 0.3), radius=0.1),),
        room=0.2,
        settings={**_SMALL, "max_bounces": 20, "tolerance": 0.0, "resolution": 13},
    ),
    "radiance at the limit": Case(
        (Shape("room"),),
        (Surface((1.0, 1.0, 1.0), (1e30, 1e30, 1e30)),),
        settings={**_SMALL, "max_bounces": 6},
    ),
    **{
        f"a lamp of {strength:g} on a quad without extent": Case(
            (Shape("quad", size=0.1), Shape("quad", size=0.0, position=(0.3, 0.3, 0.3))),
            (Surface((0.0, 0.0, 0.0)),),
            lamps=(Lamp(position=(0.3, 0.3, 0.3), strength=(strength,) * 3, soft=False, casts_shadow=False),),
            settings={**_SMALL, "resolution": 8, "max_bounces": 1, "light_samples": 1},
        )
        for strength in (1e18, 1e30)
    },
    "radiance beyond the limit by a texture": Case(
        (Shape("room"),), (Surface(emission=(1e20,) * 3, emission_map=Map(brightest=1e20)),), settings=_SMALL
    ),
    "charts thinner than a texel in closed rooms": Case(
        (Shape("quad", atlas=-1), Shape("room"), Shape("room"), Shape("quad", size=0.0)),
        (Surface((0.0, 0.0, 0.0)),),
        sky=_WHITE,
        settings={**_SMALL, "resolution": 8, "visibility": "raster", "method": "cached"},
        other={**_SMALL, "resolution": 8, "visibility": "rays", "method": "cached"},
    ),
    "texels of 1e22 square metres": Case(
        (Shape("quad", count=6, size=0.1), Shape("quad", count=5, size=2.0, uvs="tiny", smooth=True)),
        sky=_WHITE,
        scale=1e8,
        settings={**_SMALL, "visibility": "raster", "resolution": 17},
    ),
    "nothing shines": Case(settings=_SMALL),
    "white room": Case(
        (Shape("room"),), (Surface((1.0, 1.0, 1.0), (1.0, 1.0, 1.0)),), settings={**_SMALL, "max_bounces": 6}
    ),
    **{
        f"cancelled after {number} slices": Case(
            (Shape("foot"),), lamps=(Lamp(),), sky=_WHITE, settings=_SMALL, cancel=number
        )
        for number in range(0, 8, 3)
    },
}
