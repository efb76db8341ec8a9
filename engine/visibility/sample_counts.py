"""How many samples of its view a patch has, and what each takes in memory."""

from __future__ import annotations

from ..settings import Settings

#: Most patches whose numbers, one for nothing and one for the surroundings fit into 16 bits.
_NARROW = (1 << 16) - 2


def sample_bytes(sources: int, tinted: bool = False) -> int:
    """Return the bytes of a kept sample, 2 or 4: an entry of the radiance of `sources` patches.

    tinted: whether it also holds a tint, see `tints.tint_palette`
    """
    return 2 if sources <= _NARROW and not tinted else 4


def ray_count(settings: Settings) -> int:
    """Return the rays of a patch, a multiple of 4: those set, or as many as give a hemicube's error."""
    wanted = settings.samples or 2 * settings.hemicube**2
    return -(-wanted // 4) * 4


def expected_samples(settings: Settings) -> int:
    """Return how many samples a patch has, before it is known whether rays are cast or hemicubes drawn."""
    drawn = settings.visibility == "raster" or settings.directions == "hemicube" or settings.method == "paper"
    return 3 * settings.hemicube**2 if drawn else ray_count(settings)


def most_samples(settings: Settings) -> int:
    """Return how many samples a patch may have, whichever way is taken to find what it sees."""
    hemicube, rays = 3 * settings.hemicube**2, ray_count(settings)
    cast = hemicube if settings.directions == "hemicube" else rays
    return {"raster": hemicube, "rays": cast, "auto": max(hemicube, cast)}[settings.visibility]
