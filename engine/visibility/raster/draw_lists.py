"""What is drawn in a batch: clusters, each with the hemicubes or faces it is drawn into."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..views.hemicube import FACES

#: An item is a slot times this, plus a face or the bits of several faces.
_SLOT = 32

_FACE = np.arange(FACES, dtype=np.uint32)
_BIT = (1 << _FACE).astype(np.uint8)


@dataclass(frozen=True)
class DrawList:
    """One instanced draw for each cluster that is seen.

    items     (k,) uint32, cluster after cluster: the instances
    commands  (d, 5) uint32: indices, instances, first index, 0, first item (DrawElementsIndirectCommand)
    """

    items: np.ndarray
    commands: np.ndarray


def whole_draws(first: np.ndarray) -> np.ndarray:
    """Return a command for each cluster without instances, (c, 5) uint32; first: `TriangleClusters.first`."""
    commands = np.zeros((len(first) - 1, 5), np.uint32)
    commands[:, 0], commands[:, 2] = 3 * np.diff(first), 3 * first[:-1]
    return commands


def face_items(seen: np.ndarray, slots: np.ndarray, faces: range, draws: np.ndarray) -> DrawList:
    """Return a list with an instance for every face that a cluster is seen on.

    seen: (c, m, 5) bool; slots: (m,) of the hemicubes; faces: those to draw; draws: from `whole_draws`.
    """
    codes = (slots[:, None] * _SLOT + _FACE[faces.start : faces.stop]).astype(np.uint32)
    cluster, column = np.nonzero(seen[:, :, faces.start : faces.stop].reshape(len(seen), -1))
    return _listed(codes.ravel().take(column), np.bincount(cluster, minlength=len(draws)), draws)


def hemicube_items(seen: np.ndarray, slots: np.ndarray, draws: np.ndarray) -> DrawList:
    """Return a list with an instance for every hemicube that sees a cluster; see `face_items`."""
    bits = seen @ _BIT
    drawn = bits != 0
    codes = (slots * _SLOT).astype(np.uint32) + bits
    return _listed(codes[drawn], drawn.sum(axis=1), draws)


def _listed(items: np.ndarray, instances: np.ndarray, draws: np.ndarray) -> DrawList:
    """Return the draw list of items, of which `instances` (c,) belong to each cluster."""
    commands = draws.copy()
    commands[:, 1] = instances
    commands[:, 4] = np.cumsum(instances) - instances
    return DrawList(items, commands if instances.all() else commands[instances > 0])
