"""The work of the process that unwraps, with an xatlas that brings it down at meshes called "Bad"."""

import os

from engine.unwrap import segmentation, unwrapping

_segment_batch = segmentation._segment_batch


def _crash(meshes, cutting):
    if any(mesh.name.startswith("Bad") for mesh in meshes):
        os._exit(11)
    return _segment_batch(meshes, cutting)


segmentation._segment_batch = _crash
unwrap, cut = unwrapping.unwrap, unwrapping.cut
