"""Probe volume: a grid of points at which a bake computes the radiance from all directions."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

#: Maximum number of probes of a scene, 128^3; their coefficients take 290 MB (chosen).
MAX_PROBES = 1 << 21

#: Maximum resolution along an axis: the atlas then has at most 2560 x 65536 pixels.
MAX_RESOLUTION = 256

#: Largest distance that distance maps store, in diagonals of a grid cell.
_REACH = 1.5

#: Distance of the outermost probes of `filling_grid` from walls, in steps between probes. Light is constant
#: between a wall and the nearest probe (docs/design/probes.md).
_INSET = 0.05

#: Minimum width of a volume along an axis, relative to the largest coordinate: float32 resolves no smaller
#: grid.
_THIN = 1e-6


@dataclass(frozen=True)
class ProbeVolume:
    """Grid of probes in a box.

    name:        name for messages and files
    matrix:      (4, 4) float64, from the unit cube [-1, 1]^3 to world axes, m, relative to `Scene.origin`
    resolution:  number of probes along the x, y and z axes of the box
    """

    name: str
    matrix: np.ndarray
    resolution: tuple[int, int, int]

    @property
    def count(self) -> int:
        """Number of probes."""
        x, y, z = self.resolution
        return x * y * z

    @property
    def steps(self) -> np.ndarray:
        """Vectors between neighbouring probes along each axis of the box, (3, 3) float64 rows, m."""
        steps: np.ndarray = 2 * self.matrix[:3, :3].T / np.array(self.resolution)[:, None]
        return steps

    @property
    def spacing(self) -> float:
        """Smallest distance between neighbouring probes, m."""
        return float(np.linalg.norm(self.steps, axis=1).min())

    @property
    def reach(self) -> float:
        """Largest distance of maps of distances, m: 1.5 diagonals of a cell.

        Surfaces farther than that hide no probe from its own cells (Majercik et al., "Dynamic Diffuse Global
        Illumination with Ray-Traced Irradiance Fields", JCGT 2019).
        """
        return _REACH * float(np.linalg.norm(self.steps))

    def points(self) -> np.ndarray:
        """Return the probes, (n, 3) float64, m, as `matrix`; x varies fastest, then y.

        Probes lie in the middle of their cells, as in Blender: at (i + 1/2) / n of the width.
        """
        axes = [(2 * np.arange(size) + 1) / size - 1 for size in self.resolution]
        z, y, x = np.meshgrid(*axes[::-1], indexing="ij")
        grid = np.stack([x, y, z], axis=-1).reshape(-1, 3)
        points: np.ndarray = grid @ self.matrix[:3, :3].T + self.matrix[:3, 3]
        return points


def filling_grid(width: float, spacing: float) -> tuple[int, float]:
    """Return the number of probes that fill a room along an axis, and the width of their volume.

    The outermost probes are next to the walls, so the volume is nearly a step wider than the room. A room
    narrower than half a step has one probe.

    width:    between the walls, > 0
    spacing:  largest step between probes, in the unit of the width
    """
    if width < spacing / 2:
        return 1, width
    count = math.ceil(width / spacing + 1 - 2 * _INSET - 1e-6)
    return count, width * count / (count - 1 + 2 * _INSET)


def volume_issue(volume: ProbeVolume) -> str | None:
    """Return why the probes of a volume cannot be baked, as "problem. Remedy.", or None if they can."""
    if min(volume.resolution) < 1:
        return "the probe resolution is zero along an axis. Set Resolution X, Y and Z to at least 1."
    if max(volume.resolution) > MAX_RESOLUTION or volume.count > MAX_PROBES:
        size = " x ".join(map(str, volume.resolution))
        return (
            f"{size} probes exceed {MAX_RESOLUTION} along an axis or {MAX_PROBES:,} in total. Lower its "
            "resolution, or split the volume."
        )
    if not np.isfinite(volume.matrix).all():
        return "its transform is not a number. Clear its location, rotation and scale."
    axes = volume.matrix[:3, :3]
    widths, reach = 2 * np.linalg.norm(axes, axis=0), float(np.abs(volume.matrix[:3]).max(initial=0))
    if widths.min() <= _THIN * reach or abs(np.linalg.det(axes / np.maximum(widths / 2, 1e-30))) < _THIN:
        return "the volume is flat. Scale it up along all three axes."
    if np.linalg.det(axes) < 0:
        return "the volume is mirrored. Make its scale positive along all axes."
    return None
