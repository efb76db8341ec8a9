"""Work-group sizes of the hot kernels (paper, V.C), and a file of measured ones for each device."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path

from ..json_file import read_json, write_json


@dataclass(frozen=True)
class WorkSizes:
    """Work-group sizes along each axis, powers of two; a device that cannot run them halves them.

    look:           items that trace the visibility of one patch
    gather:         items that sum the cached samples of one patch
    multiply:       first kernel of the paper: texels along x and y, and layers
    reduce_row:     second kernel of the paper: columns, and rows of hemicubes
    reduce_column:  third kernel of the paper: maximum items, in columns of a hemicube
    """

    look: tuple[int] = (64,)
    gather: tuple[int] = (64,)
    multiply: tuple[int, int, int] = (32, 16, 1)
    reduce_row: tuple[int, int] = (32, 1)
    reduce_column: tuple[int] = (256,)


#: Sizes for a CPU, which runs the items of a group sequentially.
ON_PROCESSOR = WorkSizes(look=(1,), gather=(1,))


class KeptWorkSizes:
    """File of the best measured work-group sizes of a device; a damaged file counts as missing.

    folder:  folder of the file; None for no file
    device:  name of the device and its driver
    """

    def __init__(self, folder: str | None, device: str) -> None:
        self._path = None if folder is None else Path(folder) / "work_sizes.json"
        self._device = device

    def read(self, default: WorkSizes) -> WorkSizes:
        """Return the stored work-group sizes of the device; others have the values of `default`."""
        with suppress(AttributeError, TypeError, ValueError):
            return WorkSizes(**asdict(default) | _checked(read_json(self._path).get(self._device, {})))
        return default

    def keep(self, best: WorkSizes, default: WorkSizes) -> None:
        """Store the sizes that differ from the default; raises OSError."""
        if self._path is None:
            return
        usual, known = asdict(default), read_json(self._path)
        known[self._device] = {name: side for name, side in asdict(best).items() if side != usual[name]}
        write_json(self._path, known)


def _checked(kept: dict) -> dict[str, tuple[int, ...]]:
    """Return sizes by kernel; raise AttributeError, TypeError or ValueError for invalid ones."""
    axes = {name: len(sides) for name, sides in asdict(WorkSizes()).items()}
    for name, sides in kept.items():
        if len(sides) != axes.get(name) or not all(type(side) is int and _is_size(side) for side in sides):
            raise ValueError(f"{name} has no shape {sides}")
    return {name: tuple(sides) for name, sides in kept.items()}


def _is_size(side: int) -> bool:
    """Return True for powers of two that OpenCL devices may support."""
    return 1 <= side <= 1024 and side & (side - 1) == 0
