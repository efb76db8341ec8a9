"""Digests of UV layers (SHA-256), compared to detect changed lightmap UVs."""

from __future__ import annotations

import hashlib

import numpy as np


def digest_of(uvs: np.ndarray) -> str:
    """Return the SHA-256 digest of UVs, (l, 2) float32, as a hexadecimal text."""
    return hashlib.sha256(np.ascontiguousarray(uvs, np.float32).tobytes()).hexdigest()
