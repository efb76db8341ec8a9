"""The unwrap process with an xatlas that crashes at meshes named "Bad"."""

import os

from engine.unwrap import segmentation, unwrapping

_segment_batch = segmentation._segment_batch


def _crash(meshes, cutting):
    if any(mesh.name.startswith("Bad") for mesh in meshes):
        os._exit(11)
    return _segment_batch(meshes, cutting)


segmentation._segment_batch = _crash
unwrap, cut = unwrapping.unwrap, unwrapping.cut
