"""The OpenCL device the engine computes with."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import cached_property

import numpy as np

from ..errors import DeviceError
from .builders import Program
from .cl_library import start_drivers
from .driver_options import set_driver_options
from .kernel import ITEMS, Kernel, run_on
from .opencl import cl, load_opencl
from .planned_program import PlannedProgram, ProgramParts, Source
from .program_cache import Preparation, ProgramCache, build, device_digest, program_name
from .pyopencl_invokers import keep_starters_in_memory
from .shared_buffers import SharedBuffers
from .side_queue import SideQueue
from .slice_limits import slice_limits
from .source import program_source
from .staging import Staging
from .time_slicer import TimeSlicer
from .work_sizes import ON_PROCESSOR, KeptWorkSizes, WorkSizes

#: Names of Mesa's platforms, in lower case.
_MESA_PLATFORMS = ("rusticl", "clover")

#: Least size of arrays that travel through page-locked memory, bytes.
_STAGED = 1 << 17

#: Has functions of kernels that drivers may lack, as Mesa's do with another's library of them.
_PROBE = """
__kernel void probe(__global float *x)
{
    x[get_global_id(0)] = fma(sqrt(2.0f), sin(x[0]), atan2(x[1], x[2]));
}
"""


class ComputeDevice:
    """An OpenCL context and the in-order queue of bakes; the first GPU, else the first device that works.

    cache_dir, opencl_device  see `Settings`
    context_of                makes the context of a device
    ahead                     programs that begin to be built at once, see `build_ahead`
    shared                    what is uploaded once for several users
    default_sizes             shapes of the groups of the hot kernels on such a device
    work_sizes                the same as kept for this one, which may be others

    Raises DeviceError if there is no device that can build kernels.
    """

    def __init__(
        self,
        cache_dir: str | None = None,
        opencl_device: str | None = None,
        context_of: Callable[[cl.Device], cl.Context] = lambda device: cl.Context([device]),
        ahead: Iterable[PlannedProgram] = (),
    ) -> None:
        self._context_of = context_of
        keep_starters_in_memory()
        self._built: dict[tuple, cl.Program] = {}
        self._kernels: dict[tuple, Kernel] = {}
        self.shared = SharedBuffers()
        self._slice_sizes: dict[tuple, TimeSlicer] = {}
        devices = _chosen(found_devices(), opencl_device)
        self._take(devices[0], cache_dir)
        self.build_ahead(ahead)
        try:
            self._open(devices, cache_dir)
        except BaseException:
            self.release()
            raise

    def _open(self, devices: list[cl.Device], cache_dir: str | None) -> None:
        """Make the context of the first device that works, and what goes with it."""
        self.context = self._first_working_context(devices)
        if self.context.devices[0] != self.device:
            self._take(self.context.devices[0], cache_dir)
        self._programs.open(self.context)
        self.queue = cl.CommandQueue(self.context)
        self.name = self.device.name.strip()
        self.default_sizes = ON_PROCESSOR if self.processor else WorkSizes()
        self.work_sizes = self.kept_sizes(cache_dir).read(self.default_sizes)

    def _take(self, device: cl.Device, cache_dir: str | None) -> None:
        """Take a device, which need not have a context yet."""
        self.device, self._begun = device, set[ProgramParts]()
        folder = None if self._is_pocl and not self.processor else cache_dir
        self._programs = ProgramCache(device, folder, keeps_itself=self._is_pocl)
        self._early, self._planned, self._own = set[str](), set[str](), list[ProgramParts]()
        self._prelude = ("pocl_inline.cl",) if self._is_pocl and self.processor else ()

    def kept_sizes(self, cache_dir: str | None) -> KeptWorkSizes:
        """Return the shapes that a folder keeps for this device."""
        return KeptWorkSizes(cache_dir, f"{self.name}, {device_digest(self.device)}")

    @property
    def processor(self) -> bool:
        """True for a CPU, which runs the items of a group one after the other."""
        return bool(self.device.type & cl.device_type.CPU)

    @cached_property
    def staging(self) -> Staging:
        """What large arrays travel through."""
        return Staging(self.queue)

    def is_staged(self, size: int) -> bool:
        """Return whether an array of `size` bytes travels by `staging`: a large one, not to a CPU."""
        return size >= _STAGED and not self.processor

    @property
    def _is_pocl(self) -> bool:
        """True for PoCL, which keeps its kernels in files itself, built for the sizes of groups they ran in.

        Asked for the binary of a program it builds all kernels a second time, for groups of any size. On some
        processors it calls what others inline; see kernels/device/pocl_inline.cl.
        """
        return bool(self.device.platform.name == "Portable Computing Language")

    def kernels(self, source: str | Source, *names: str, options: Sequence[str] = ()) -> list[Kernel]:
        """Build kernels/<source>, or several records and main files one after another.

        Returns kernels in the names' order. Who asks for a kernel again gets the same one: making one takes
        a while.
        """
        key, program = self._program(source, options)
        for name in names:
            if (key, name) not in self._kernels:
                self._kernels[key, name] = Kernel(program, name, self.device)
        return [self._kernels[key, name] for name in names]

    def beside(self, source: Source, name: str, options: Sequence[str] = ()) -> SideQueue:
        """Return a kernel that another thread starts while this one bakes."""
        _, program = self._program(source, options)
        return SideQueue(self._queue_beside, Kernel(program, name, self.device))

    def _program(self, source: str | Source, options: Sequence[str]) -> tuple[ProgramParts, cl.Program]:
        """Return what a program is built of, and the program."""
        parts = (source,) if isinstance(source, str) else source
        key = parts, tuple(options)
        if key not in self._built:
            self._built[key] = self._programs.build(self._text(parts), options)
        return key, self._built[key]

    @cached_property
    def _queue_beside(self) -> cl.CommandQueue:
        return cl.CommandQueue(self.context)

    def build_ahead(self, programs: Iterable[PlannedProgram]) -> None:
        """Begin to build the programs of this kind of device in other processes; each once.

        Binaries of a GPU, and kernels that PoCL keeps for a CPU.
        """
        if self._is_pocl != self.processor:
            return
        planned = [one for one in programs if one.for_processor == self.processor]
        new = [one for one in planned if one.key not in self._begun and one.key not in self._built]
        self._begun.update(one.key for one in new)
        named = {}
        for one in new:
            program = Program(self._text(one.parts), one.options, one.launches if self.processor else None)
            name = program_name(program.source, program.options)
            named[name] = program
            self._planned.add(name)
            if one.is_early:
                self._early.add(name)
        left = self._programs.begin(named.values()) if new else set()
        self._own += [one.key for one, name in zip(new, named, strict=True) if name in left and one.is_early]

    def build_own(self) -> Iterator[None]:
        """Build the programs that `build_ahead` left to this process and that direct light needs."""
        while self._own:
            self._program(*self._own.pop(0))
            yield

    def preparation(self, early: bool = False) -> Preparation | None:
        """Return how far the builds of `build_ahead` are, None once they have ended.

        early: wait only for the programs that direct light needs
        """
        left = self._programs.preparation(self._early if early else self._planned)
        if left is None and not early:
            self._programs.keep_pace()
        return left

    def release(self) -> None:
        """Build nothing ahead any more."""
        self._programs.stop()

    def _text(self, parts: Source) -> str:
        return program_source((*self._prelude, *parts))

    def slice_size(self, kernel: Kernel, *work: object, items: int = 1) -> TimeSlicer:
        """Return the controller of slice sizes of a kernel for some work, which earlier work has adapted.

        work   what the time of an item depends on
        items  work items that a kernel starts for each item of a slice
        """
        key = (kernel, *work)
        if key not in self._slice_sizes:
            self._slice_sizes[key] = TimeSlicer(slice_limits(self.device, kernel.preferred_items, items))
        return self._slice_sizes[key]

    def run(self, kernel: Kernel, items: int, *arguments: object, layers: int = 1) -> None:
        """Run a kernel for at least `items` work items of each layer; it has to ignore those beyond."""
        run_on(self.queue, kernel, items, *arguments, layers=layers)

    def run_texels(self, kernel: Kernel, shape: tuple[int, ...], *arguments: object) -> None:
        """Run a kernel for at least every texel of images, (images, height, width); see texel.cl."""
        images, height, width = shape
        group = kernel.group(ITEMS, 1, 1)
        items = (-(-width // group[0]) * group[0], height, images)
        kernel(self.queue, items, group, *arguments, np.int32(width), np.int32(height))

    def _first_working_context(self, devices: list[cl.Device]) -> cl.Context:
        """Return a context of the first device that builds a kernel.

        A PoCL older than the processor it runs on is listed but cannot build any. The first device is tried
        twice if processes build for it: they may have what it lacks.
        """
        failures: dict[str, str] = {}
        for device in [devices[0], *devices] if self._begun else devices:
            try:
                return _probed(self._context_of(device))
            except cl.Error as error:
                self.release()
                version = device.platform.version.strip()
                failures[f"{device.name.strip()} ({version})"] = _reason(error)
        reasons = "; ".join(f"{device}: {reason}" for device, reason in failures.items())
        raise DeviceError(f"No OpenCL device can build kernels: {reasons}. {remedy(sys.platform)}")


def _probed(context: cl.Context) -> cl.Context:
    """Return a context that has built a kernel; raises cl.Error."""
    build(context, _PROBE)
    return context


def trouble_with(device: cl.Device) -> str:
    """Return why a device cannot build kernels, empty if it can."""
    try:
        _probed(cl.Context([device]))
    except cl.Error as error:
        return _reason(error)
    return ""


def device_name(device: cl.Device) -> str:
    """Return the name of a device as the settings have it: its platform's, and its own."""
    return f"{device.platform.name.strip()}: {device.name.strip()}"


def _chosen(devices: list[cl.Device], name: str | None) -> list[cl.Device]:
    """Return the devices of a name, all of them without one; several platforms may offer the same."""
    chosen = [device for device in devices if name in (None, device_name(device))]
    if not chosen:
        offered = ", ".join(f"'{known}'" for known in dict.fromkeys(map(device_name, devices)))
        raise DeviceError(
            f"There is no OpenCL device '{name}'. Choose one of {offered}, or none for the best, in "
            "Hemibake's preferences."
        )
    return chosen


def found_devices() -> list[cl.Device]:
    """Return every device, the best kind first: GPU, accelerator, then anything else.

    Of one kind those of a vendor's driver precede those of Mesa's.
    """
    set_driver_options()
    load_opencl()
    start_drivers()
    try:
        devices = [device for platform in cl.get_platforms() for device in platform.get_devices()]
    except cl.Error as error:
        raise DeviceError(f"OpenCL could not be started ({error}). {remedy(sys.platform)}") from error
    if not devices:
        raise DeviceError(f"There is no OpenCL device. {remedy(sys.platform)}")
    return sorted(devices, key=_rank)


def _rank(device: cl.Device) -> tuple[int, bool]:
    kinds = (cl.device_type.GPU, cl.device_type.ACCELERATOR)
    kind = next((rank for rank, kind in enumerate(kinds) if device.type & kind), len(kinds))
    return kind, device.platform.name.strip().lower() in _MESA_PLATFORMS


def _reason(error: cl.Error) -> str:
    """Return the most telling line of an OpenCL error."""
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    return next((line for line in lines if "error:" in line.lower()), lines[0])


def remedy(system: str) -> str:
    """Return what brings an OpenCL device to a system, by the name that `sys.platform` has there."""
    driver = "Install the current driver of your graphics card"
    if system == "linux":
        return (
            f"{driver}, or PoCL, which computes on the processor: on Debian or Ubuntu "
            "apt install pocl-opencl-icd, on Fedora dnf install pocl, on Arch pacman -S pocl."
        )
    return "OpenCL is part of macOS; update the system." if system == "darwin" else f"{driver}."
