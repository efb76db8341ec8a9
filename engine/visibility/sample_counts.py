"""Numbers and sizes of visibility samples per patch."""

from __future__ import annotations

from ..settings import Settings

#: Maximum number of patches whose entries, with one for none and one for the background, fit in 16 bits.
_NARROW = (1 << 16) - 2


def sample_bytes(sources: int, tinted: bool = False) -> int:
    """Return the bytes of a cached sample, 2 or 4: an index into the radiance of `sources` patches.

    tinted: True if samples also hold a tint, see `tints.tint_palette`
    """
    return 2 if sources <= _NARROW and not tinted else 4


def ray_count(settings: Settings) -> int:
    """Return the rays per patch, a multiple of 4: the setting, or enough for a hemicube's error."""
    wanted = settings.samples or 2 * settings.hemicube**2
    return -(-wanted // 4) * 4


def expected_samples(settings: Settings) -> int:
    """Return the samples per patch that the settings ask for, by rays or by drawn hemicubes."""
    drawn = settings.visibility == "raster" or settings.directions == "hemicube" or settings.method == "paper"
    return 3 * settings.hemicube**2 if drawn else ray_count(settings)
