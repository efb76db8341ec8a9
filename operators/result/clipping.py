"""Warnings about light that the lightmap files cannot represent."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from ...engine.encoding.encoding import Limits, find_clipping
from ...engine.encoding.signed_norm import SignedNorm
from ...engine.encoding.srgb import Srgb
from ...engine.object_message import ObjectMessage, object_message
from ..file_format import RANGED
from ..scene import ReadScene
from ..scene.uvs.uv_faults import covered_texels
from .lightmap_files import LightmapFile

#: Fraction of a lightmap's texels that may become black without a warning, as the far falloff of lights does,
#: or lose negative channels.
_DARK = 0.01


def clipping_notes(
    read: ReadScene, files: Sequence[LightmapFile], has_patch: np.ndarray
) -> Iterator[ObjectMessage]:
    """Yield a warning for each kind of clipping in a file.

    files:      one file for each lightmap, all atlases of each output in turn
    has_patch:  (atlases, h, w) bool, baked texels; others are ignored
    """
    for index, file in enumerate(files):
        limits, atlas = file.format.limits(file.encoding), index % len(has_patch)
        if limits is None:
            continue
        for sentence, texels in _sentences(file, limits, has_patch[atlas]):
            yield object_message(sentence, _objects_at(read, atlas, texels))


def _sentences(file: LightmapFile, limits: Limits, counted: np.ndarray) -> Iterator[tuple[str, np.ndarray]]:
    """Yield each warning about a file, with {} for the objects, and its clipped texels, (h, w) bool."""
    clipping, all_texels = find_clipping(file.light, limits, counted), max(int(counted.sum()), 1)
    bright, dark, negative = (
        max(texels.sum() / all_texels, 0.001) if texels.any() else 0.0
        for texels in (clipping.bright, clipping.dark, clipping.negative)
    )
    if bright:
        yield _too_bright(file, limits, clipping.bright, bright), clipping.bright
    if dark > _DARK:
        sentence = (
            f"{dark:.1%} of its texels (on {{}}) are darker than {limits.smallest:.2g} and became black"
        )
        yield f"'{file.name}': {sentence}. {_remedy_for_dark(file)}.", clipping.dark
    if negative > _DARK and _is_unsigned(file):
        sentence = f"{negative:.1%} of its texels (on {{}}) have colors outside Rec.709, which became duller"
        yield f"'{file.name}': {sentence}. Choose OpenEXR, which keeps negative channels.", clipping.negative


def _is_unsigned(file: LightmapFile) -> bool:
    """Return True if a file stores no negative values."""
    return file.encoding is not None and not isinstance(file.encoding, SignedNorm)


def _too_bright(file: LightmapFile, limits: Limits, clipped: np.ndarray, fraction: float) -> str:
    """Return the warning about texels above the maximum, with {} for the objects."""
    brightest = np.where(clipped, np.abs(file.light).max(axis=-1), -np.inf)
    row, column = np.unravel_index(int(brightest.argmax()), clipped.shape)
    height, width = clipped.shape
    most = float(brightest.max())
    return (
        f"'{file.name}': {fraction:.1%} of its texels (on {{}}) were clipped to {limits.largest:.5g}. "
        f"The brightest had {most:.5g}, at texel {column}, {row}, UV {(column + 0.5) / width:.3f}, "
        f"{(row + 0.5) / height:.3f}. {_remedy_for_bright(file, most)}."
    )


def _remedy_for_bright(file: LightmapFile, most: float) -> str:
    """Return the remedy for clipped bright texels: a setting that lets the format store the value `most`."""
    if isinstance(file.encoding, Srgb) and np.isfinite(most):
        return f"Choose an Exposure of {np.floor(-10 * np.log2(most)) / 10:g}, or another format"
    if file.format.name in RANGED:
        return f"Choose a Range of {1.001 * most:.4g} or more, or 0"
    return "Choose OpenEXR with 32-bit floats"


def _remedy_for_dark(file: LightmapFile) -> str:
    if isinstance(file.encoding, Srgb):
        return "Raise the Exposure, or choose another format"
    return (
        "Choose a higher Gamma, or another format" if file.format.name in RANGED else "Choose 32-bit floats"
    )


def _objects_at(read: ReadScene, atlas: int, texels: np.ndarray) -> list[str]:
    """Return the names of the objects with charts at texels of an atlas, (h, w) bool."""
    resolution = len(texels)
    chosen = np.pad(texels, ((0, 0), (0, 1))).ravel()
    names = [
        mesh.name
        for mesh in read.scene.meshes
        if mesh.atlas == atlas and chosen[covered_texels(mesh.uvs, resolution)[0]].any()
    ]
    return list(dict.fromkeys(names))
