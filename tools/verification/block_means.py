"""Means over blocks of fine texels, restricted to valid ones."""

from __future__ import annotations

import numpy as np


def block_means(fine: np.ndarray, known: np.ndarray, width: int) -> np.ndarray:
    """Return the means over what is known of blocks `width` wide, (atlases, h, w, c) float32; 0 for nothing.

    fine:   (atlases, width * h, width * w, c) float32
    known:  of the same shape, bool
    """
    means: np.ndarray = _sums(np.where(known, fine, 0), width) / np.maximum(_sums(known, width), 1)
    return means


def block_shares(known: np.ndarray, width: int) -> np.ndarray:
    """Return the part that is known of blocks `width` wide, (atlases, h, w, c) float32."""
    shares: np.ndarray = _sums(known, width) / width**2
    return shares


def _sums(fine: np.ndarray, width: int) -> np.ndarray:
    """Return the sums over blocks, (atlases, h, w, c) float32."""
    atlases, rows, columns, channels = fine.shape
    blocks = fine.reshape(atlases, rows // width, width, columns // width, width, channels)
    sums: np.ndarray = blocks.sum(axis=(2, 4), dtype=np.float32)
    return sums
