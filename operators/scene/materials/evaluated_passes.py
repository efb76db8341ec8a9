"""Lists the Cycles evaluations that a material needs, and makes their pixels physical."""

from __future__ import annotations

from typing import NamedTuple

import bpy
import numpy as np

from ..slice_timer import Slices, row_slices
from .closures import QUANTITIES, closure_quantities, passes_evenly
from .engine_materials import MAX_SHARED
from .object_nodes import Dependence
from .ray_kinds import BOUNCE, RayKind
from .tree_nodes import used_nodes

#: Opaque fraction below which a texel reflects, transmits and emits nothing.
SMALLEST_PART = 1e-3


class Pass(NamedTuple):
    """One evaluation of a material.

    quantity:  one of `closures.QUANTITIES`
    rays:      kind of ray for which it is evaluated
    """

    quantity: str
    rays: RayKind = BOUNCE


#: Key of the coverage mask, (h, w) bool: texels that faces or chart margins cover. It is not evaluated.
COVERED = Pass("covered")

#: Pixels of each evaluation, (h, w, 3) float32, and the coverage mask under COVERED.
Pixels = dict[Pass, np.ndarray]


def passes_of(material: bpy.types.Material, depends: Dependence, glass: bool) -> list[Pass]:
    """Return the evaluations that a material needs: quantities that can differ from 0."""
    found: set[str] = set()
    for node in used_nodes(material.node_tree):
        found |= set(closure_quantities(node, glass))
        if any(_takes_color(socket) for socket in node.inputs):
            found.add("emit")
    if glass and not any(map(passes_evenly, used_nodes(material.node_tree))):
        found.discard("glass")  # all light passes glass
    sides = (False, True) if depends.by_side else (False,)
    passes = [
        Pass(quantity, RayKind(back=back))
        for back in sides
        for quantity in QUANTITIES
        if quantity in found and not (back and quantity == "transmit")
    ]
    if depends.by_ray:
        passes += [
            Pass(quantity, RayKind(True, back))
            for quantity in ("through", "glass")
            if quantity in found
            for back in sides
        ]
    return passes


def _takes_color(socket: bpy.types.NodeSocket) -> bool:
    """Return True if a colour is linked to a shader input, which Cycles treats as emission."""
    return socket.type == "SHADER" and any(link.from_socket.type != "SHADER" for link in socket.links)


def finish_passes(pixels: Pixels) -> Slices[None]:
    """Clamp the quantities to physical values in place, and divide light by each texel's opaque fraction."""
    images = {each: image for each, image in pixels.items() if each != COVERED}
    size = len(next(iter(images.values()), ()))
    for rows in row_slices(size, 3 * len(images) * size):
        for image in images.values():
            np.maximum(np.nan_to_num(image[rows]), 0, out=image[rows])
        for back in (False, True):
            side = {
                each.quantity: image[rows] for each, image in images.items() if each.rays == (False, back)
            }
            _finish_side(side)
        for each, image in images.items():
            if each.rays.shadow:
                np.minimum(image[rows], 1, out=image[rows])
        yield rows.stop / size


def _finish_side(side: dict[str, np.ndarray]) -> None:
    """Finish the quantities of one side for gathered light, (h, w, 3) float32 each, in place.

    Afterwards, reflected, transmitted and straight-through light of a channel add up to 1 at most, before the
    division by the opaque fraction. See `engine_materials.MAX_SHARED`.
    """
    scattered = [side[name] for name in ("reflect", "transmit") if name in side]
    through, emit = side.get("through"), side.get("emit")
    lit = [*scattered, *([] if emit is None else [emit])]
    room: np.ndarray = np.ones((), np.float32)
    factor = room
    if through is not None:
        np.minimum(through, 1, out=through)
        for each in lit:
            np.minimum(through, MAX_SHARED, out=through, where=each.any(axis=2, keepdims=True))
        room = 1 - through
        stopped = room.min(axis=2, keepdims=True)
        factor = np.where(stopped > SMALLEST_PART, 1 / np.maximum(stopped, SMALLEST_PART), 0)
    if scattered:
        total = scattered[0] if len(scattered) == 1 else scattered[0] + scattered[1]
        share = np.minimum(room / np.maximum(total, 1e-30), 1) * factor
        for each in scattered:
            each *= share
    if emit is not None:
        emit *= factor
