"""Bounding volume hierarchy (BVH) over triangles, built by OpenCL."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...device.buffers import download, lasting_buffer, upload, zeros
from ...device.cl_device import ComputeDevice
from ...device.device_struct import DeviceStruct
from ...device.opencl import cl
from .upper_levels import NAMES as TREETOP
from .upper_levels import UpperLevels

#: Padding clusters at both ends of a row, and values summed per work item, as in kernels/rays/bvh.cl.
_FAR, _CHUNK = 8, 32

#: Size of a work group; less where the device's limit is lower.
_GROUP = 256

#: Maximum number of triangles for a BVH that is built top-down only, without merging of clusters (PLOC).
_TOP = 2048

#: Maximum number of wide nodes of a level for one work group, and capacity of its output.
_SMALL, _ROOM = 1024, 1 << 15

#: Minimum fraction of clusters that a merging round must remove. Otherwise clusters are merged in pairs,
#: which bounds the depth.
_FEWEST = 1 / 16

#: Margin of boxes in binary nodes, relative to the largest coordinate: 8 float32 rounding errors.
_MARGIN = 8 * 2.0**-24

#: Granularity of traversal stack sizes, nodes, which limits the number of programs.
_STACK = 64

#: Node of the binary hierarchy: its box and its children.
BOX = DeviceStruct(
    "NodeBox",
    ("float[3]", "low", "m, corner of the box"),
    ("float", "cost", "of a ray in the node (surface area heuristic), m^2"),
    ("float[3]", "high", "m, corner of the box"),
)
LINK = DeviceStruct(
    "NodeLink",
    ("int", "left", "child; of a node of one triangle its number"),
    ("int", "right", "child, -1 for a node of one triangle"),
    ("int", "triangles", "in the node"),
    ("int", "leaf", "1 if a ray tests all of them"),
)


@dataclass(frozen=True)
class BvhLayout:
    """Layout of a BVH.

    width:   children of a node: 2, 4 or 8
    packet:  triangles of a leaf that are tested at once: 1, 2, 4 or 8
    leaf:    maximum number of triangles of a leaf, at most 7 packets
    cost:    cost of a packet test relative to a node test
    top:     number of clusters at which merging stops; these are joined top-down, which gives better boxes
             but takes longer
    """

    width: int
    packet: int
    leaf: int
    cost: float
    top: int = 2048


#: CPU layout: tests as many boxes and triangles at once as a vector register holds. On a GPU each lane tests
#: one.
_PROCESSOR = BvhLayout(8, 8, 8, 0.5, 512)
_GRAPHICS = BvhLayout(2, 1, 2, 0.5)


@dataclass(frozen=True)
class Bvh:
    """Nodes and packets of triangles on the device, as kernels/rays/bvh_traversal.cl reads them.

    nodes:      `width` boxes and children each
    triangles:  packets
    options:    build options of the layout, for kernels/rays/bvh_traversal.cl
    levels:     depth of the tree
    stack:      size of the traversal stack, nodes
    top:        upper levels, reusable for the same triangles at other positions; None for many triangles
    """

    nodes: cl.Buffer
    triangles: cl.Buffer
    options: tuple[str, ...]
    levels: int
    stack: int
    top: UpperLevels | None = None


def shape_for(compute: ComputeDevice) -> BvhLayout:
    """Return the layout that a device traverses fastest."""
    return _PROCESSOR if compute.processor else _GRAPHICS


def build_bvh(
    compute: ComputeDevice,
    positions: np.ndarray,
    reach: float,
    shape: BvhLayout | None = None,
    top: UpperLevels | None = None,
) -> Bvh:
    """Build the BVH of triangles, (t, 3, 3) float32, t >= 1.

    Clusters along a Morton curve merge with their best neighbours (PLOC; Meister and Bittner 2018). The
    remaining clusters are joined top-down, or by the tree of `top`. Binary nodes then collapse to wide nodes.

    reach:  largest coordinate of a corner, metres
    top:    upper levels of the same triangles at earlier positions
    """
    return _Builder(compute, positions, reach, shape or shape_for(compute), top).build()


@dataclass(frozen=True)
class _Level:
    """Wide nodes of successive levels.

    children:  binary nodes that are their children
    before:    prefix sums of inner children and of packets
    totals:    offsets of these sums per chunk
    count:     number of nodes
    packets:   number of packets in their leaves
    depth:     number of levels
    origin:    offset of the inner children, relative to the first of these nodes
    """

    children: cl.Buffer
    before: cl.Buffer
    totals: cl.Buffer
    count: int
    packets: int
    depth: int
    origin: int


def _small_limit(compute: ComputeDevice) -> int:
    """Return the maximum number of wide nodes of a level that one launch collapses with all later levels.

    A CPU gets a launch per level, which is cheap there: PoCL 7.1 compiles `open_levels` to code that crashes.
    """
    return 0 if compute.processor else _SMALL


class _Builder:
    def __init__(
        self,
        compute: ComputeDevice,
        positions: np.ndarray,
        reach: float,
        shape: BvhLayout,
        top: UpperLevels | None,
    ) -> None:
        self._compute, self._queue, self._shape, self._top = compute, compute.queue, shape, top
        self._count = len(positions)
        options = _layout(shape, _STACK)
        options += (f"-DLEAF={shape.leaf}", f"-DPACKET_COST={shape.cost}f")
        names = (
            "morton_keys", "single_clusters", "best_neighbours", "count_merges", "sum_chunks",
            "sum_totals", "merge", "open_nodes", "open_levels", "next_roots", "store_level", *TREETOP,
        )  # fmt: skip
        kernels = compute.kernels((BOX, LINK, "bvh.cl", "bvh_upper_levels.cl"), *names, options=options)
        self._kernels = dict(zip(names, kernels, strict=True))
        self._boxes, self._links = (
            self._buffer(2 * record.dtype.itemsize * self._count) for record in (BOX, LINK)
        )
        self._positions = lasting_buffer(compute, positions.astype(np.float32, copy=False))
        self._reach = max(reach, 1e-30)

    def build(self) -> Bvh:
        """Build the BVH by merging, joining and widening; return it."""
        bvh = self._widen(self._join(*self._merge(*self._sorted())))
        # A CPU reads the caller's positions, which may not outlive this call.
        if self._compute.processor:
            self._queue.finish()
        return bvh

    def _sorted(self) -> tuple[cl.Buffer, int]:
        """Return sorted Morton keys, with triangle indices in the lowest bits, and the mask of these bits.

        Scenes of at most `_TOP` triangles need no order; their keys are the indices.
        """
        bits = max(int(self._count - 1).bit_length(), 1)
        if self._count <= _TOP:
            return upload(self._compute, np.arange(self._count, dtype=np.uint64)), (1 << bits) - 1
        keys = np.empty(self._count, np.uint64)
        buffer = self._buffer(keys.nbytes)
        scale = np.float32(1 / self._reach)
        self._run(
            "morton_keys", self._count, self._positions, scale, np.int32(bits), buffer,
            np.int32(self._count),
        )  # fmt: skip
        cl.enqueue_copy(self._queue, keys, buffer)
        keys.sort()
        cl.enqueue_copy(self._queue, buffer, keys)
        return buffer, (1 << bits) - 1

    def _merge(self, keys: cl.Buffer, mask: int) -> tuple[cl.Buffer, int, int]:
        """Merge clusters until few are left; return their nodes, their number, and the number of nodes."""
        count, made, stride = self._count, self._count, self._count + 2 * _FAR
        rows, new_rows = (self._buffer(24 * stride) for _ in range(2))
        cluster, new_cluster = (self._buffer(4 * count) for _ in range(2))
        best, before = self._buffer(4 * count), self._buffer(8 * count)
        totals = self._buffer(8 * (-(-count // _CHUNK) + 1))
        nodes = self._boxes, self._links
        self._run(
            "single_clusters", stride, self._positions, keys, np.uint64(mask), rows,
            np.int32(stride), cluster, *nodes, np.int32(count),
        )  # fmt: skip
        fewest = self._shape.top if count > _TOP else count
        while count > fewest:
            self._run("best_neighbours", count, rows, np.int32(stride), best, np.int32(count))
            for paired in (np.int32(0), np.int32(1)):
                chunks = -(-count // _CHUNK)
                self._run("count_merges", chunks, best, paired, before, totals, np.int32(count))
                left, merged = self._sum_totals(totals, chunks)
                if merged >= _FEWEST * count:
                    break
            self._run(
                "merge", count, best, paired, before, totals, rows, cluster, new_rows, new_cluster,
                np.int32(stride), np.int32(left), *nodes, np.int32(made), np.int32(count),
            )  # fmt: skip
            rows, new_rows, cluster, new_cluster = new_rows, rows, new_cluster, cluster
            count, made = left, made + merged
        return cluster, count, made

    def _join(self, cluster: cl.Buffer, count: int, made: int) -> int:
        """Build the nodes above the merged clusters, numbered from `made` on; return the root.

        The upper levels of an earlier build are reused if they fit the new positions well.
        """
        nodes, known = (self._boxes, self._links), self._top if self._count <= _TOP else None
        if known and known.count == count and known.refit(self._kernels, *nodes):
            return known.root
        top = UpperLevels(self._compute, self._kernels, *nodes, cluster, count, made)
        self._top = top if self._count <= _TOP else None
        return top.root

    def _widen(self, root: int) -> Bvh:
        """Collapse binary nodes to wide ones, level by level, and store them.

        Small levels run in one launch, except on a CPU.
        """
        levels, roots = [], upload(self._compute, np.array([root], np.int32))
        count = 1
        while count:
            widen = self._small_levels if count <= _small_limit(self._compute) else self._level
            level, roots, count = widen(roots, count)
            levels.append(level)

        # Allocate the nodes and packets, whose numbers are known now.
        record, packet = 32 * self._shape.width, 4 * self._shape.packet * _record(self._shape)
        nodes = self._buffer(record * sum(level.count for level in levels))
        packets = self._buffer(packet * sum(level.packets for level in levels))
        first, first_packet, margin = 0, 0, np.float32(_MARGIN * self._reach)
        for level in levels:
            self._run(
                "store_level", level.count, self._positions, self._boxes, self._links,
                level.children, level.before, level.totals, np.int32(first), np.int32(first + level.origin),
                np.int32(first_packet), nodes, packets, margin, np.int32(level.count),
            )  # fmt: skip
            first, first_packet = first + level.count, first_packet + level.packets
        depth = sum(level.depth for level in levels)
        need = depth * (self._shape.width - 1) + 1
        stack = -(-need // _STACK) * _STACK
        return Bvh(nodes, packets, _layout(self._shape, stack), depth, stack, self._top)

    def _level(self, roots: cl.Buffer, count: int) -> tuple[_Level, cl.Buffer, int]:
        """Collapse one level of binary nodes.

        Return its wide nodes and the binary nodes of the next level.
        """
        chunks = -(-count // _CHUNK)
        children = self._buffer(4 * self._shape.width * count)
        before, totals = self._buffer(8 * count), self._buffer(8 * (chunks + 1))
        self._run("open_nodes", count, self._boxes, self._links, roots, children, before, np.int32(count))
        self._run("sum_chunks", chunks, before, totals, np.int32(count))
        count_next, packets = self._sum_totals(totals, chunks)
        following = self._buffer(max(4 * count_next, 4))
        if count_next:
            self._run("next_roots", count, self._links, children, before, totals, following, np.int32(count))
        return _Level(children, before, totals, count, packets, 1, count), following, count_next

    def _small_levels(self, roots: cl.Buffer, count: int) -> tuple[_Level, cl.Buffer, int]:
        """Collapse all remaining levels in one launch if they are small; return as `_level` does."""
        width, kernel = self._shape.width, self._kernels["open_levels"]
        (group,) = kernel.group(_GROUP)
        following = [self._buffer(4 * width * _SMALL) for _ in range(2)]
        children, before, made = self._buffer(4 * width * _ROOM), self._buffer(8 * _ROOM), self._buffer(16)
        kernel(
            self._queue, (group,), (group,), self._boxes, self._links, roots, *following, children, before,
            made, *map(np.int32, (count, _SMALL, _ROOM)), cl.LocalMemory(8 * (group + 1)),
        )  # fmt: skip
        totals = zeros(self._compute, 8 * (_ROOM // _CHUNK))
        nodes, depth, left, packets = map(int, download(self._compute, made, (4,)).view(np.int32))
        level = _Level(children, before, totals, nodes, packets, depth, 0)
        return level, following[(depth + 1) % 2], left

    def _sum_totals(self, totals: cl.Buffer, chunks: int) -> tuple[int, int]:
        """Compute prefix sums of the chunks' totals; return the sum over all chunks."""
        kernel = self._kernels["sum_totals"]
        group = kernel.group(_GROUP)
        kernel(self._queue, group, group, totals, np.int32(chunks), cl.LocalMemory(8 * group[0]))
        sums = np.empty(2, np.int32)
        cl.enqueue_copy(self._queue, sums, totals, src_offset=8 * chunks)
        return int(sums[0]), int(sums[1])

    def _run(self, name: str, items: int, *arguments: object) -> None:
        """Run a kernel in work groups of one size, because PoCL compiles a kernel again for each size."""
        (size,) = self._kernels[name].group(_GROUP)
        self._kernels[name](self._queue, (-(-items // size) * size,), (size,), *arguments)

    def _buffer(self, size: int) -> cl.Buffer:
        return cl.Buffer(self._compute.context, cl.mem_flags.READ_WRITE, size)


def _layout(shape: BvhLayout, stack: int) -> tuple[str, ...]:
    """Return the build options of kernels for a layout."""
    sizes = {"WIDTH": shape.width, "PACKET": shape.packet, "RECORD": _record(shape), "STACK": stack}
    return tuple(f"-D{name}={value}" for name, value in sizes.items())


def _record(shape: BvhLayout) -> int:
    """Return the floats per triangle; single triangles are padded to load as float4."""
    return 12 if shape.packet == 1 else 10
