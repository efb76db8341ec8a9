"""Random .blend files and what is done with them: descriptions that print as they are written."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

from hypothesis import strategies as st

Vector = tuple[float, float, float]

#: Kinds of objects; "multi-user" has the mesh of the one before it, "collection" and "nodes" make instances.
THINGS = (
    "quad", "cube", "inward cube", "ball", "ngon", "loose edges", "nothing", "NaN vertex",
    "far vertex", "flat", "multi-user", "collection", "nodes", "curve", "text", "metaball", "empty",
    "armature", "lattice",
)  # fmt: skip

#: Modifiers, by their type in Blender.
MODIFIERS = (
    "SUBSURF", "BEVEL", "SOLIDIFY", "ARRAY", "MIRROR", "DISPLACE", "TRIANGULATE", "DECIMATE",
    "WIREFRAME", "SCREW", "REMESH", "EDGE_SPLIT", "WELD", "SMOOTH", "BUILD", "SKIN", "UV_PROJECT",
    "NODES",
)  # fmt: skip

#: What stands where the surface of a material comes from.
SURFACES = (
    "principled", "diffuse", "emission", "mix", "add", "transparent", "glass", "image",
    "image and mapping", "normal image", "missing image", "noise", "vertex colour", "object info",
    "attribute", "geometry", "group", "muted", "nothing", "no output", "volume", "holdout",
    "mix of nothing", "backfacing", "light path",
)  # fmt: skip

LAMP_NODES = ("none", "plain", "blackbody", "IES", "falloff", "noise", "image", "no output")

WORLDS = ("none", "colour", "image", "odd image", "missing image", "sky", "noise", "no output")

#: What is done, in this order.
STEPS = ("bake", "preview", "unwrap", "cancel", "save", "undo push")


@dataclass(frozen=True)
class Thing:
    """An object.

    uvs:      names of its UV layers; the one of lightmaps has texels of its own for each face
    spread:   of lightmap UVs: 1 fills the square, more leaves it
    slots:    materials by number, None for an empty slot; `linked` says where they are linked
    indices:  material indices of the faces, in turn
    """

    kind: str = "cube"
    location: Vector = (0.0, 0.0, 0.0)
    scale: Vector = (1.0, 1.0, 1.0)
    modifiers: tuple[str, ...] = ()
    uvs: tuple[str, ...] = ()
    spread: float = 0.9
    slots: tuple[int | None, ...] = (0,)
    linked: str = "DATA"
    indices: tuple[int, ...] = (0,)
    role: str = "BAKED"
    atlas: str = "Lightmap"
    selected: bool = False
    hidden: str = ""
    colour_attribute: bool = False
    child: bool = False


@dataclass(frozen=True)
class Lamp:
    """A light object."""

    kind: str = "POINT"
    location: Vector = (0.0, 0.0, 2.0)
    scale: Vector = (1.0, 1.0, 1.0)
    energy: float = 10.0
    size: float = 0.1
    nodes: str = "none"
    portal: bool = False


@dataclass(frozen=True)
class Case:
    """A file and what is done with it.

    slices:  after which a bake is cancelled
    mode:    of the active object, where it has that mode
    saved:   whether the file has been saved before
    """

    things: tuple[Thing, ...] = (Thing(),)
    surfaces: tuple[str, ...] = ("principled",)
    lamps: tuple[Lamp, ...] = ()
    world: str = "none"
    settings: dict[str, Any] = field(default_factory=dict)
    steps: tuple[str, ...] = ("bake",)
    slices: int = 3
    active: int | None = 0
    mode: str = "OBJECT"
    saved: bool = False


def _among(ordinary: list, odd: list) -> st.SearchStrategy:
    """Return values of which one in eight is odd."""
    return st.integers(0, 7).flatmap(lambda dice: st.sampled_from(odd if dice == 7 else ordinary))


def _triple(numbers: st.SearchStrategy[float]) -> st.SearchStrategy[Vector]:
    return st.one_of(numbers.map(lambda value: (value,) * 3), st.tuples(numbers, numbers, numbers))


_LOCATION = _triple(_among([0.0, 1.0, -1.0, 0.5], [1e-6, 100.0, 1e5, -1e7]))
_SCALE = st.one_of(st.just((1.0, 1.0, 1.0)), _triple(_among([1.0, 0.5, -1.0], [0.0, 1e-6, 1000.0])))

_THINGS = st.builds(
    Thing,
    kind=_among(
        ["quad", "cube", "inward cube", "ball", "ngon", "multi-user", "collection", "curve"], list(THINGS)
    ),
    location=_LOCATION,
    scale=_SCALE,
    modifiers=st.one_of(st.just(()), st.lists(st.sampled_from(MODIFIERS), max_size=2).map(tuple)),
    uvs=st.sampled_from([(), (), ("UVMap",), ("Lightmap",), ("UVMap", "Lightmap"), ("Lightmap", "Äpfel")]),
    spread=_among([0.9, 0.9, 1.0, 1.00005], [0.0, 3.0, float("nan")]),
    slots=st.lists(st.sampled_from([0, 0, 1, 2, None]), max_size=3).map(tuple),
    linked=st.sampled_from(["DATA", "DATA", "OBJECT"]),
    indices=st.sampled_from([(0,), (0, 1, 2, 3), (1,), (7, 0)]),
    role=_among(["BAKED"], ["NO_LIGHTMAP", "IGNORED"]),
    atlas=st.sampled_from(["Lightmap", "Lightmap", "Other", "", "Ä/b:c*"]),
    selected=st.booleans(),
    hidden=_among([""], ["viewport", "render", "eye", "layer"]),
    colour_attribute=st.booleans(),
    child=st.booleans(),
)

#: Seen and with faces, so that there is something to bake.
_FIRST_THINGS = st.builds(
    replace,
    _THINGS,
    kind=st.sampled_from(["quad", "cube", "inward cube", "ball", "ngon"]),
    scale=st.just((1.0, 1.0, 1.0)),
    role=st.just("BAKED"),
    hidden=st.just(""),
)

_LAMPS = st.builds(
    Lamp,
    kind=st.sampled_from(["POINT", "SPOT", "SUN", "AREA"]),
    location=_LOCATION,
    scale=_SCALE,
    energy=_among([1.0, 10.0], [0.0, -5.0, 1e6, 1e30]),
    size=_among([0.0, 0.1, 1.0], [1e-6, 100.0]),
    nodes=_among(["none"], list(LAMP_NODES)),
    portal=_among([False], [True]),
)

_SETTINGS = st.fixed_dictionaries(
    {"resolution": _among([16, 31, 48], [8, 9]), "hemicube": st.just("8"), "max_bounces": st.integers(1, 3)},
    optional={
        "method": st.sampled_from(["auto", "cached", "stream", "paper"]),
        "visibility": st.sampled_from(["auto", "raster", "rays"]),
        "outputs": _among(
            [("combined",), ("combined", "direct"), ("ambient_occlusion",), ("combined", "shadow_mask")],
            [(), ("shadow_mask",), ("ambient_occlusion", "combined", "direct", "indirect", "shadow_mask")],
        ),
        "samples": st.sampled_from([0, 4, 16]),
        "light_samples": st.sampled_from([1, 4]),
        "ao_samples": st.sampled_from([1, 4]),
        "margin": st.sampled_from([0, 8]),
        "uv_layer": st.sampled_from(["Lightmap", "UVMap", "Neu"]),
        "directory": st.sampled_from(
            ["//lightmaps/", "{folder}/plain", "{folder}/file", "/proc/nowhere", ""]
        ),
        "tolerance": st.sampled_from([0.0, 0.01]),
        "sample_emission": st.booleans(),
    },
)

CASES: st.SearchStrategy[Case] = st.builds(
    Case,
    things=st.tuples(_FIRST_THINGS, st.lists(_THINGS, max_size=3)).map(lambda parts: (parts[0], *parts[1])),
    surfaces=st.lists(
        _among(["principled", "diffuse", "emission", "image"], list(SURFACES)), min_size=1, max_size=3
    ).map(tuple),
    lamps=st.lists(_LAMPS, max_size=2).map(tuple),
    world=_among(["none", "colour", "image"], list(WORLDS)),
    settings=_SETTINGS,
    steps=st.lists(st.sampled_from(STEPS), min_size=1, max_size=4).map(lambda steps: (*steps, "bake"))
    | st.just(("bake",)),
    slices=st.integers(0, 12),
    active=st.one_of(st.none(), st.integers(0, 3)),
    mode=_among(["OBJECT"], ["EDIT", "SCULPT", "VERTEX_PAINT", "WEIGHT_PAINT", "TEXTURE_PAINT"]),
    saved=st.booleans(),
)

_INSTANCED = Thing("nodes", slots=(0,))
_SMALL = {"resolution": 31, "hemicube": "8", "max_bounces": 2, "light_samples": 4, "ao_samples": 4}

_EXAMPLES: dict[str, Case] = {
    "sky of odd size": Case(world="odd image"),
    "nodes of a flat lamp": Case(lamps=(Lamp(scale=(1e-6, 1.0, -1.0), nodes="image"),)),
    "Render Result stays": Case(world="noise"),
    "Render Result stays after a cancel": Case(world="noise", steps=("cancel",)),
    "value of the object": Case((Thing(), Thing("multi-user", (3, 0, 0))), ("object info",)),
    "attribute of the object": Case((Thing(), Thing("multi-user", (3, 0, 0))), ("attribute",)),
    **{
        f"{kind} modifier": Case(
            (Thing("quad", uvs=("Lightmap",), modifiers=(kind,)), Thing("cube", (3, 0, 0)))
        )
        for kind in MODIFIERS
    },
    "modifiers that copy faces, no UVs": Case(
        (Thing(modifiers=("SOLIDIFY", "ARRAY")), Thing("quad", (9, 0, 0)))
    ),
    "distant vertex": Case((Thing("far vertex"), Thing("quad", (3, 0, 0)))),
    "NaN vertex": Case((Thing("NaN vertex"), Thing("quad", (3, 0, 0)))),
    **{f"lamp with {nodes}": Case(lamps=(Lamp(nodes=nodes),)) for nodes in LAMP_NODES},
    **{
        f"{kind} scaled to 0": Case(lamps=(Lamp(kind, scale=(0.0, 0.0, 0.0)),))
        for kind in ("POINT", "SPOT", "SUN", "AREA")
    },
    "material indices without slots": Case(
        (Thing(slots=(), indices=(0, 1, 2, 3)),), steps=("bake", "preview", "preview", "bake")
    ),
    "preview over empty slots": Case(
        (Thing(slots=(None, 0, None), linked="OBJECT", indices=(0, 1, 2)),), steps=("bake", "preview", "save")
    ),
    "cancelled at once": Case(steps=("cancel", "bake", "cancel", "cancel"), slices=0),
    "no outputs": Case(settings={**_SMALL, "outputs": ()}),
    "nothing shines": Case(surfaces=("diffuse",)),
    "negative lamp": Case(lamps=(Lamp(energy=-5.0),)),
    "bright lamp": Case(lamps=(Lamp(energy=1e28),)),
    **{
        f"in mode {mode}": Case((Thing(uvs=("UVMap",)),), mode=mode, steps=("bake", "cancel"))
        for mode in ("EDIT", "SCULPT", "VERTEX_PAINT", "WEIGHT_PAINT", "TEXTURE_PAINT")
    },
    "missing images": Case(surfaces=("missing image",), world="missing image"),
    "vertex colour on an object without faces": Case(
        (Thing("quad"), Thing("cube", (3, 0, 0), slots=(1,), modifiers=("BUILD",))),
        ("diffuse", "vertex colour"),
    ),
    "instances": Case((Thing("collection", slots=()), _INSTANCED)),
}

#: What once went wrong, by what went wrong.
EXAMPLES = {name: replace(case, settings=_SMALL | case.settings) for name, case in _EXAMPLES.items()}

#: Those that have to be refused.
REFUSED = {"no outputs"}
