"""What is drawn in a batch: clusters, each with the hemicubes or faces it is drawn into."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..hemicube import FACES

#: An item is a slot times this, plus a face or the bits of several faces.
_SLOT = 32


@dataclass(frozen=True)
class DrawList:
    """One instanced draw for each cluster that is seen.

    items     (k,) uint32, cluster after cluster: the instances
    commands  (d, 5) uint32: indices, instances, first index, 0, first item (DrawElementsIndirectCommand)
    """

    items: np.ndarray
    commands: np.ndarray


def face_items(seen: np.ndarray, slots: np.ndarray, faces: range, first: np.ndarray) -> DrawList:
    """Return a list with an instance for every face that a cluster is seen on.

    seen: (c, m, 5) bool; slots: (m,) of the hemicubes; faces: those to draw; first: `Clusters.first`.
    """
    codes = (slots[:, None] * _SLOT + np.arange(FACES)[faces]).astype(np.uint32)
    return _listed(seen[:, :, faces], codes, first)


def hemicube_items(seen: np.ndarray, slots: np.ndarray, first: np.ndarray) -> DrawList:
    """Return a list with an instance for every hemicube that sees a cluster; see `face_items`."""
    bits = seen @ (1 << np.arange(FACES))
    codes = (slots * _SLOT + bits).astype(np.uint32)
    return _listed(bits > 0, codes, first)


def _listed(seen: np.ndarray, codes: np.ndarray, first: np.ndarray) -> DrawList:
    """Return the list of what is seen: seen (c, ...) bool, codes of the instances, broadcast to its shape."""
    instances = np.count_nonzero(seen.reshape(len(seen), -1), axis=1)
    commands = np.zeros((len(seen), 5), np.uint32)
    commands[:, 0] = 3 * np.diff(first)
    commands[:, 1] = instances
    commands[:, 2] = 3 * first[:-1]
    commands[:, 4] = np.cumsum(instances) - instances
    return DrawList(np.broadcast_to(codes, seen.shape)[seen], commands[instances > 0])
