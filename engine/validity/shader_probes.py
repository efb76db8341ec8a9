"""Probe rays of compute shaders: contacts, lit back faces and push-off, for machines without OpenCL."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..visibility.rays.receiver_records import RECEIVER
from ..visibility.rays.shaders.shader_scene import ShaderScene
from ..visibility.rays.shaders.shader_tables import ShaderTables, reserve_storage
from ..visibility.rays.shaders.shader_tracer import RECORDS, RESULTS, Uniforms, read_rows
from .thresholds import KERNEL_OPTIONS

#: Storage block of shaders/validity/validity.glsl.
_TABLES = 6

#: STATE_WORDS of shaders/validity/push_off.comp.
_PUSH_OFF_STATE = 6

#: The thresholds as definitions of GLSL.
_FEATURES = tuple(option.removeprefix("-D").replace("=", " ") for option in KERNEL_OPTIONS)


def contact_codes(scene: ShaderScene, above: float, below: float) -> np.ndarray:
    """Return the contact of each patch, (n,) float32: 0 for none, 1 for covered, 2 for back-to-back.

    above, below: extent of the rays above and below the surface, in heights of the ray origins
    """
    found = _probe(scene, "contacts", {}, {"above": above, "below": below, "has_lit": 0}, 1)
    return found[:, 0]


def lit_by_back_faces(scene: ShaderScene, shines: np.ndarray, planes: np.ndarray) -> np.ndarray:
    """Return a mask of patches that back faces light, (n,) bool; see kernels/validity/lit_by_backs.cl.

    shines: (t,) bool, emissive triangles; planes: (k, 4) float32, see `contact.patches_lit_by_backs`
    """
    tables = {"lit": shines.astype(np.uint32), "planes": planes.astype(np.float32, copy=False)}
    uniforms = {"plane_count": len(planes), "has_lit": 1}
    lit: np.ndarray = _probe(scene, "lit_by_backs", tables, uniforms, 1)[:, 0] != 0
    return lit


def push_offs(
    scene: ShaderScene, reach: float, normals: np.ndarray, lit: np.ndarray | None
) -> tuple[np.ndarray, np.ndarray]:
    """Return the push-off of each point.

    Returns (n, 4) float32, offset and thickness, m; and (n, 4) int32: wall, two sides, result of the
    test of kernels/validity/push_off.cl.

    reach:    maximum length of the rays, texels
    normals:  (t, 3) float32, unit, of the triangles
    lit:      (t,) bool, triangles whose back faces send out light; None if no back face has patches
    """
    tables = {"normals": normals.astype(np.float32, copy=False)}
    if lit is not None:
        tables["lit"] = lit.astype(np.uint32)
    uniforms = {"reach": reach, "has_lit": int(lit is not None)}
    found = _probe(scene, "push_off", tables, uniforms, 2, _PUSH_OFF_STATE).reshape(-1, 2, 4)
    return found[:, 0], np.ascontiguousarray(found[:, 1]).view(np.int32)


def _probe(
    scene: ShaderScene,
    shader: str,
    tables: Mapping[str, np.ndarray],
    uniforms: Uniforms,
    rows: int,
    state_words: int = 0,
) -> np.ndarray:
    """Run a shader of probe rays; return `rows` rows of results per point, (rows n, 4) float32."""
    words, size = ShaderTables(scene.graphics, tables), rows * scene.count
    results = reserve_storage(scene.graphics, 16 * size)
    buffers = {RECORDS: scene.receivers, _TABLES: words.buffer, RESULTS: results}
    launch = {**words.uniforms, **uniforms}
    for _ in scene.tracer.run(shader, scene.count, buffers, launch, _FEATURES, (RECEIVER,), state_words):
        pass
    return read_rows(results, size)
