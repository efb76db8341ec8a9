"""A processor that the engine takes for a graphics card, where tests have no card."""

from collections.abc import Sequence

from engine.device.cl_device import ComputeDevice
from engine.device.kernel import Kernel

#: Work items that the least of graphics cards has in a group.
_ITEMS = 256


class GraphicsCard(ComputeDevice):
    """An OpenCL device whose groups, of at most 256 items, work on one patch each."""

    processor = False

    def kernels(self, source: str | Sequence[str], *names: str, options: Sequence[str] = ()) -> list[Kernel]:
        """Build kernels that run in groups as small as a card's."""
        kernels = super().kernels(source, *names, options=options)
        for kernel in kernels:
            kernel.most_items = min(kernel.most_items, _ITEMS)
        return kernels
