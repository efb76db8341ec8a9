"""Sentences for the user on problems with objects, one for each kind of problem, with a remedy."""

from __future__ import annotations

from ...engine.object_message import object_message
from ...engine.scene.checks import LARGEST

#: Consequences for the object.
_LEFT_OUT = "left out of the bake"
_SEEN = "blocks and reflects light, but gets no lightmap"

NO_FACES = f"no faces with an area: {_LEFT_OUT}. Add faces, or set the role to Ignored."
NOT_FINITE = (
    f"NaN or infinite vertex coordinates: {_LEFT_OUT}. Delete those vertices, "
    "or check the modifiers and the object's scale."
)
NORMALS_NOT_FINITE = (
    f"NaN or infinite normals: {_LEFT_OUT}. Clear its custom normals, or check the object's scale."
)
TOO_FAR = (
    f"reaching more than {LARGEST / 1000:,.0f} km away: {_LEFT_OUT}. Delete distant vertices, "
    "or check the object's location and scale."
)
NOT_FINITE_UVS = f"NaN or infinite lightmap UVs: {_SEEN}. Unwrap again."
OVERLAPPING = (
    f"overlapping lightmap UVs: {_SEEN}. Unwrap without overlaps, "
    "or delete the lightmap UV layer for a new one."
)
NO_UVS = f"faces without lightmap UVs: {_SEEN}. Unwrap, or apply modifiers on a copy."
NO_TILE = (
    f"too many objects and instances share the mesh, or overlap in the atlas, for lightmaps of this "
    f"resolution: {_SEEN}. Raise the resolution, or set the role of less important ones to No Lightmap."
)
LINKED = (
    f"no lightmap UVs of its own, and linked from another file: {_SEEN}. Make local or override, "
    "unwrap in that file, or apply modifiers on a copy."
)
WITHOUT_XATLAS = (
    "The package xatlas is missing, so Blender's Smart UV Project makes the lightmap UVs. They have more "
    "charts and fill less of the lightmap. For better ones, unwrap the objects into that UV layer yourself."
)
XATLAS_FAILED = (
    "xatlas cannot cut these meshes: {}. Blender's Smart UV Project made their lightmap UVs, with more "
    "charts. For better ones, use Mesh > Clean Up, or unwrap them into that UV layer yourself."
)
MANY_LAYERS = f"8 UV layers, as many as Blender allows, and none for the lightmap: {_SEEN}. Remove one."


def no_space_message(resolution: int) -> str:
    """Return the sentence for charts that do not fit a lightmap; `resolution` 0 if none is large enough."""
    raised = f"Raise the resolution to {resolution}" if resolution else "Raise the resolution"
    return (
        f"too many charts for a lightmap of this resolution: {_SEEN}. {raised}, "
        "or merge faces into fewer UV islands."
    )


def attribute_in_the_way(uv_layer: str) -> str:
    """Return the sentence for an attribute with the lightmap UV layer's name that is not a UV layer."""
    return (
        f"an attribute called '{uv_layer}' that is not a UV layer: {_SEEN}. Rename it, "
        "or choose another name for the lightmap UV layer."
    )


class Issues:
    """Objects by problem, collected while a scene is read."""

    def __init__(self) -> None:
        self._names: dict[str, set[str]] = {}

    def add(self, sentence: str, name: str) -> None:
        """Record a problem of an object."""
        self._names.setdefault(sentence, set()).add(name)

    @property
    def names(self) -> set[str]:
        """Names of all objects with problems."""
        return set().union(*self._names.values())

    def messages(self) -> list[str]:
        """Return one sentence for each kind of problem, with the names of its objects."""
        return [
            object_message(f"{'Objects' if len(names) > 1 else 'Object'} {{}}: {sentence}", sorted(names))
            for sentence, names in self._names.items()
        ]
