"""Instanced draws: for each cluster of triangles, the hemicubes or faces on which it may be visible."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..views.hemicube import FACES

#: An item is a slot times this, plus a face index or a bit mask of faces.
_SLOT = 32

_FACE = np.arange(FACES, dtype=np.uint32)
_BIT = (1 << _FACE).astype(np.uint8)


@dataclass(frozen=True)
class DrawList:
    """One instanced draw for each visible cluster.

    items:     (k,) uint32, instances, cluster by cluster
    commands:  (d, 5) uint32: indices, instances, first index, 0, first item (DrawElementsIndirectCommand)
    """

    items: np.ndarray
    commands: np.ndarray


def whole_draws(first: np.ndarray) -> np.ndarray:
    """Return a draw command of each whole cluster with 0 instances, (c, 5) uint32.

    first:  (c + 1,) start of each cluster, `TriangleClusters.first`
    """
    commands = np.zeros((len(first) - 1, 5), np.uint32)
    commands[:, 0], commands[:, 2] = 3 * np.diff(first), 3 * first[:-1]
    return commands


def face_items(seen: np.ndarray, slots: np.ndarray, faces: range, draws: np.ndarray) -> DrawList:
    """Return a draw list with one instance for each face on which a cluster is visible.

    seen:   (c, m, 5) bool, visibility by cluster, hemicube and face
    slots:  (m,) slots of the hemicubes
    faces:  faces to draw
    draws:  commands from `whole_draws`
    """
    codes = (slots[:, None] * _SLOT + _FACE[faces.start : faces.stop]).astype(np.uint32)
    cluster, column = np.nonzero(seen[:, :, faces.start : faces.stop].reshape(len(seen), -1))
    return _listed(codes.ravel().take(column), np.bincount(cluster, minlength=len(draws)), draws)


def hemicube_items(seen: np.ndarray, slots: np.ndarray, draws: np.ndarray) -> DrawList:
    """Return a draw list with one instance for each hemicube on which a cluster is visible."""
    bits = seen @ _BIT
    drawn = bits != 0
    codes = (slots * _SLOT).astype(np.uint32) + bits
    return _listed(codes[drawn], drawn.sum(axis=1), draws)


def _listed(items: np.ndarray, instances: np.ndarray, draws: np.ndarray) -> DrawList:
    """Build a draw list from items; instances: (c,) number of items of each cluster."""
    commands = draws.copy()
    commands[:, 1] = instances
    commands[:, 4] = np.cumsum(instances) - instances
    return DrawList(items, commands if instances.all() else commands[instances > 0])
