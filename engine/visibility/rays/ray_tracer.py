"""Ray tracer over the triangles of a scene, by OpenCL."""

from __future__ import annotations

import numpy as np

from ...array_ops import to_float4
from ...device.buffers import upload
from ...device.cl_device import ComputeDevice
from ...device.device_struct import DeviceStruct
from ...device.kernel import Kernel
from ...device.opencl import cl
from ...device.planned_program import Source
from ...scene.cutouts import BOUNCE, EXTENSIONS, Cutouts
from ...scene.tints import tint_palette
from ...scene.triangles import Triangles
from .bvh import Bvh, build_bvh
from .receiver_records import RECEIVER, TEXEL_STEP
from .upper_levels import UpperLevels

#: Transmittance of one side of a material for one kind of ray; see `Cutouts`.
TRANSMITTANCE = DeviceStruct(
    "Transmittance",
    ("float[3]", "base", "opacity of each channel without the map"),
    ("float", "threshold", "of opacity, from which on all light is stopped; -1 for none"),
    ("float[3]", "factor", "of the map, added to the base"),
    ("int", "channels", "values of a pixel of the map, 1 or 3"),
    ("int", "first", "value of the map"),
    ("int", "width", "pixels, 0 without a map"),
    ("int", "height", "pixels"),
    ("int", "extension", "index into EXTENSIONS: how the map goes on beyond its borders"),
    ("int", "nearest", "1 if the nearest pixel is taken, 0 if four are interpolated"),
    ("int", "first_corner", "of the map's layer in the list of corners of all layers"),
    ("float", "ior", "index of refraction"),
    ("float", "share", "of the transmittance that passes glass and falls with the angle of incidence"),
    ("float", "faces", "of glass that light crosses"),
    ("float", "body", "1 for the front and 2 for the back of a closed body, 0 for other surfaces"),
)


#: Records and kernel files of single rays and of receiver records, built as one program: faster than three
#: builds.
SOURCE: Source = (RECEIVER, TEXEL_STEP, "closest_hit.cl", "pack_receivers.cl", "ray_offsets.cl")


class RayTracer:
    """Triangles of a scene on the OpenCL device, for bvh_traversal.cl and kernels that include it.

    compute:    OpenCL device
    cutouts:    transmittance of the surfaces
    arguments:  kernel arguments for RAYS_ARGUMENTS
    bvh:        of the triangles that are no back faces
    """

    def __init__(
        self,
        compute: ComputeDevice,
        triangles: Triangles,
        cutouts: Cutouts,
        before: UpperLevels | None = None,
        bvh: Bvh | None = None,
    ) -> None:
        """Build the BVH, or use an existing one of the same triangles.

        before: `Bvh.top` of the same triangles at earlier positions
        """
        self.compute, self._queue = compute, compute.queue
        self.cutouts = cutouts
        reach = float(np.abs(triangles.box).max())
        bvh = bvh or build_bvh(compute, triangles.positions[: triangles.solid], reach, top=before)
        self._options, self.bvh = bvh.options, bvh
        arrays: list[np.ndarray] = []
        if cutouts.needed:
            self._options = (*bvh.options, *cutout_options(cutouts.tinted, cutouts.angular))
            arrays = [cutouts.pixels, transmittance_records(cutouts), cutouts.uvs, triangles.material]
            tints = tint_palette(cutouts)
            arrays += [] if tints is None else [tints]
        self.arguments = (bvh.nodes, bvh.triangles, *(upload(compute, array) for array in arrays))

    def kernels(self, source: Source, *names: str, options: tuple[str, ...] = ()) -> list[Kernel]:
        """Return kernels, in the order of names, of a program that includes bvh_traversal.cl."""
        return self.compute.kernels((TRANSMITTANCE, *source), *names, options=(*self._options, *options))

    def hierarchy_of(self, positions: np.ndarray) -> tuple[cl.Buffer, cl.Buffer] | None:
        """Return nodes and packets of other triangles, (k, 3, 3) float32, for the same kernels.

        Positions are in metres from `Triangles.origin`. None if the tree is too deep for the kernels' stacks.
        """
        bvh = build_bvh(self.compute, positions, float(np.abs(positions).max()))
        return (bvh.nodes, bvh.triangles) if bvh.stack <= self.bvh.stack else None

    def cast(
        self, origins: np.ndarray, directions: np.ndarray, backs: bool = False, kind: int = BOUNCE
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the closest hit of each ray; only back faces count if `backs`.

        origins, directions:  (m, 3) float, world space, metres from `Triangles.origin`
        kind:                 SHADOW or BOUNCE of engine/scene/cutouts.py, selects the transmittance

        Returns triangle (m,) int32, -1 for none; front (m,) bool; distance (m,) float32 in lengths of the
        direction.
        """
        count = len(origins)
        hits, distances = np.empty((count, 2), np.int32), np.empty(count, np.float32)
        write = cl.mem_flags.WRITE_ONLY
        outputs = [cl.Buffer(self.compute.context, write, array.nbytes) for array in (hits, distances)]
        rays = self._rays(origins, directions, 0.0)
        (kernel,) = self.kernels(SOURCE, "closest_hit")
        self.run(kernel, count, *rays, np.int32(backs), np.int32(kind), *outputs, np.int32(count))
        for array, buffer in zip((hits, distances), outputs, strict=True):
            cl.enqueue_copy(self._queue, array, buffer)
        return hits[:, 0], hits[:, 1] != 0, distances

    def transmittance(
        self, origins: np.ndarray, directions: np.ndarray, distance: float, kind: int = BOUNCE
    ) -> np.ndarray:
        """Return the transmittance along each ray up to a distance, (m, 3) float32, rgb.

        origins, directions:  (m, 3) float as in `cast`
        distance:             in lengths of the direction
        kind:                 SHADOW or BOUNCE of engine/scene/cutouts.py, selects the transmittance
        """
        through = np.empty((len(origins), 3), np.float32)
        output = cl.Buffer(self.compute.context, cl.mem_flags.WRITE_ONLY, through.nbytes)
        rays = self._rays(origins, directions, distance)
        (kernel,) = self.kernels(("through_surface.cl",), "through_surface")
        self.run(kernel, len(origins), *rays, np.int32(kind), output, np.int32(len(origins)))
        cl.enqueue_copy(self._queue, through, output)
        return through

    def run(self, kernel: Kernel, items: int, *arguments: object) -> None:
        """Run a kernel with RAYS_ARGUMENTS followed by `arguments`; see `ComputeDevice.run`."""
        self.compute.run(kernel, items, *self.arguments, *arguments)

    def _rays(self, origins: np.ndarray, directions: np.ndarray, distance: float) -> list[cl.Buffer]:
        """Upload rays and return their buffers."""
        rays = (to_float4(origins), to_float4(directions, last=distance))
        return [upload(self.compute, array) for array in rays]


def cutout_options(tinted: bool, angular: bool) -> tuple[str, ...]:
    """Return the build options of kernels that trace rays through transparent surfaces."""
    return "-DTRANSMISSION", *(("-DTINTED",) if tinted else ()), *(("-DANGULAR",) if angular else ())


def transmittance_records(cutouts: Cutouts) -> np.ndarray:
    """Return the records of materials, (r,) TRANSMITTANCE."""
    first, width, height, code = cutouts.maps.T
    return TRANSMITTANCE.array(
        len(cutouts.maps),
        base=cutouts.base,
        threshold=cutouts.threshold,
        factor=cutouts.factor,
        channels=cutouts.channels,
        first=first,
        width=width,
        height=height,
        extension=code % len(EXTENSIONS),
        nearest=code >= len(EXTENSIONS),
        first_corner=cutouts.layer * (3 * cutouts.uvs.shape[1]),
        ior=cutouts.fresnel[:, 0],
        share=cutouts.fresnel[:, 1],
        faces=cutouts.fresnel[:, 2],
        body=cutouts.fresnel[:, 3],
    )
