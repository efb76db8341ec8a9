"""Sample directions over the sphere, with icosahedral symmetry, so that SH L2 is integrated without error."""

from __future__ import annotations

from functools import cache

import numpy as np

#: Rotations of an icosahedron. Any polynomial of degree 5 or less has the same mean over an orbit of these
#: as over the sphere (Goethals and Seidel, "The football", 1981), and products of two SH L2 have degree 4.
SYMMETRY = 60

#: Increments of the R2 sequence (Roberts 2018): 1/g and 1/g^2 of the plastic number g.
_R2 = np.array([0.7548776662466927, 0.5698402909980532])

#: Search for evenly separated directions: number of offsets into the R2 sequence that are tried, and number
#: of directions whose distances to all others rate an offset (chosen).
_SHIFTS, _COMPARED = 32, 64


def direction_count(samples: int) -> int:
    """Return the number of directions for at least `samples`: a multiple of SYMMETRY."""
    return -(-samples // SYMMETRY) * SYMMETRY


@cache
def sphere_directions(samples: int) -> np.ndarray:
    """Return unit directions, (`direction_count`, 3) float64, of equal weight over the sphere.

    The R2 sequence fills a triangle that is a sixtieth of the sphere, uniformly in area; the rotations of an
    icosahedron repeat it. So projections to SH L2 have no error for radiance of band 2 or less.
    """
    orbits = direction_count(samples) // SYMMETRY
    shifts = range(_SHIFTS if orbits <= _COMPARED else 1)
    directions = max((_directions(orbits, shift) for shift in shifts), key=_separation)
    directions.setflags(write=False)
    return directions


def _directions(orbits: int, shift: int) -> np.ndarray:
    """Return the directions of some orbits, (60 orbits, 3), from the R2 sequence after a shift."""
    points = (0.5 + np.arange(shift + 1, shift + orbits + 1)[:, None] * _R2) % 1
    seeds = _in_spherical_triangle(points, _FUNDAMENTAL)
    return np.einsum("rij,oj->roi", _rotations(), seeds).reshape(-1, 3)


def _separation(directions: np.ndarray) -> float:
    """Return the smallest angle between the first directions and all others, as the negative cosine."""
    cosines = directions[:_COMPARED] @ directions.T
    np.fill_diagonal(cosines, -1)
    return -float(cosines.max())


def random_rotations(count: int, seed: int) -> np.ndarray:
    """Return uniformly distributed rotations as unit quaternions x, y, z, w, (count, 4) float32.

    Shoemake, "Uniform Random Rotations", Graphics Gems III, 1992.
    """
    u, v, w = np.random.default_rng(seed).random((3, count))
    v, w = 2 * np.pi * v, 2 * np.pi * w
    low, high = np.sqrt(1 - u), np.sqrt(u)
    quaternions = np.stack([low * np.sin(v), low * np.cos(v), high * np.sin(w), high * np.cos(w)], axis=1)
    return quaternions.astype(np.float32)


def _axes() -> tuple[np.ndarray, np.ndarray]:
    """Return a vertex and a neighbouring vertex of an icosahedron, unit, (3,) each."""
    golden = (1 + np.sqrt(5)) / 2
    first, second = np.array([0, 1, golden]), np.array([0, -1, golden])
    return first / np.linalg.norm(first), second / np.linalg.norm(second)


@cache
def _rotations() -> np.ndarray:
    """Return the rotations of an icosahedron, (60, 3, 3) float64: products of two generators."""
    vertex, other = _axes()
    generators = [_turn(vertex, 2 * np.pi / 5), _turn(vertex + other, np.pi)]
    found = [np.eye(3)]
    for known in found:
        for generator in generators:
            product = generator @ known
            if not any(np.allclose(product, one) for one in found):
                found.append(product)
    return np.stack(found)


def _turn(axis: np.ndarray, angle: float) -> np.ndarray:
    """Return the rotation about an axis, (3, 3) (Rodrigues)."""
    x, y, z = axis / np.linalg.norm(axis)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    turned: np.ndarray = np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
    return turned


def _fundamental() -> np.ndarray:
    """Return the corners of a spherical triangle whose rotated copies tile the sphere, (3, 3).

    Two corners are the ends of an edge of the icosahedron, the third is the middle of a face at that edge.
    """
    vertex, other = _axes()
    third = _turn(vertex, 2 * np.pi / 5) @ other
    middle = vertex + other + third
    return np.stack([vertex, other, middle / np.linalg.norm(middle)])


_FUNDAMENTAL = _fundamental()


def _in_spherical_triangle(points: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Map the unit square, (n, 2), to a spherical triangle, (3, 3), uniformly in area (Arvo 1995)."""
    a, b, c = corners
    angle = _dihedral(a, b, c)
    area = angle + _dihedral(b, c, a) + _dihedral(c, a, b) - np.pi
    turn, cosine_c = area * points[:, 0] - angle, float(a @ b)
    s, t = np.sin(turn), np.cos(turn)
    u, v = t - np.cos(angle), s + np.sin(angle) * cosine_c
    q = ((v * t - u * s) * np.cos(angle) - v) / ((v * s + u * t) * np.sin(angle))
    q = q.clip(-1, 1)[:, None]
    across = c - (c @ a) * a
    end = q * a + np.sqrt(1 - q * q) * across / np.linalg.norm(across)
    z = (1 - points[:, 1] * (1 - end @ b))[:, None]
    side = end - (end @ b)[:, None] * b
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    inside: np.ndarray = z * b + np.sqrt(np.maximum(1 - z * z, 0)) * side
    return inside


def _dihedral(corner: np.ndarray, one: np.ndarray, other: np.ndarray) -> float:
    """Return the angle of a spherical triangle at a corner, rad."""
    first, second = np.cross(corner, one), np.cross(corner, other)
    cosine = first @ second / np.linalg.norm(first) / np.linalg.norm(second)
    return float(np.arccos(np.clip(cosine, -1, 1)))
