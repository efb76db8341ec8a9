"""OpenCL device: context, queue, programs and kernels."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import cached_property

import numpy as np

from ..errors import DeviceError
from .builders import Program
from .cl_library import start_drivers
from .device_records import SEARCH, DeviceKey, DeviceRecords
from .driver_options import needed_replacements, set_driver_options
from .kernel import ITEMS, Kernel, SideQueue, run_on
from .opencl import cl, keep_starters_in_memory, load_opencl
from .peer_threads import PeerThread
from .planned_program import PlannedProgram, ProgramParts, Source
from .program_cache import (
    Preparation,
    ProgramCache,
    device_digest,
    marks_folder,
    program_name,
)
from .shared_buffers import SharedBuffers
from .slice_limits import slice_limits
from .source import program_source
from .staging import Staging
from .time_slicer import TimeSlicer
from .work_sizes import ON_PROCESSOR, KeptWorkSizes, WorkSizes

#: Lower-case names of Mesa's platforms.
_MESA_PLATFORMS = ("rusticl", "clover")

#: Minimum size in bytes of arrays that are copied through page-locked memory.
_STAGED = 1 << 17


class ComputeDevice:
    """OpenCL context with the in-order queue of bakes, on the first GPU, else on the first working device.

    cache_dir, opencl_device:  see `Settings`
    context_of:                creates the context of a device
    ahead:                     programs that are built ahead, see `build_ahead`
    key, notes:                of the device, and sentences about devices that are skipped
    shared:                    cache of uploaded arrays
    thread:                    runs the tasks of this device if it shares the bake of another one
    default_sizes:             default work-group sizes of the hot kernels for this kind of device
    work_sizes:                measured sizes stored for this device, else the default

    Raises DeviceError if no device can build kernels.
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
        self.thread = PeerThread()
        self.shared = SharedBuffers()
        self._slice_sizes: dict[tuple, TimeSlicer] = {}
        self._records = DeviceRecords(cache_dir)
        devices = _chosen(search_devices(self._records, opencl_device), opencl_device)
        devices, self.notes = _usable(devices, opencl_device, self._records)
        self._take(devices[0], cache_dir)
        planned = list(ahead)
        self.build_ahead(planned)
        try:
            self._open(devices, cache_dir)
        except BaseException:
            self.release()
            raise
        if self._replacements:
            self.build_ahead(planned)

    def _open(self, devices: list[cl.Device], cache_dir: str | None) -> None:
        """Create the context of the first working device, its queue and work-group sizes."""
        self.context = self._first_working_context(devices)
        if self._replacements or self.context.devices[0] != self.device:
            # Other processes build programs for another device, or without the replacements.
            self._programs.stop()
            self._take(self.context.devices[0], cache_dir)
        self._prelude += self._replacements
        self._programs.open(self.context)
        self.queue = cl.CommandQueue(self.context)
        self.name = self.device.name.strip()
        self.default_sizes = ON_PROCESSOR if self.processor else WorkSizes()
        self.work_sizes = self.kept_sizes(cache_dir).read(self.default_sizes)

    def _take(self, device: cl.Device, cache_dir: str | None) -> None:
        """Select a device, which need not have a context yet."""
        self.device, self._begun = device, set[ProgramParts]()
        folder = cache_dir
        if self._is_pocl:
            folder = marks_folder(cache_dir) if self.processor else None
        self._programs = ProgramCache(device, folder, keeps_itself=self._is_pocl)
        self.key = DeviceKey(device_digest(device), device_name(device))
        self._records.use(self.key)
        self._early, self._planned, self._own = set[str](), set[str](), list[ProgramParts]()
        self._prelude: Source = ("pocl_inline.cl",) if self._is_pocl and self.processor else ()

    def kept_sizes(self, cache_dir: str | None) -> KeptWorkSizes:
        """Return the store of work-group sizes in a folder for this device."""
        return KeptWorkSizes(cache_dir, f"{self.name}, {device_digest(self.device)}")

    @property
    def processor(self) -> bool:
        """True for a CPU, which runs the items of a group sequentially."""
        return bool(self.device.type & cl.device_type.CPU)

    @cached_property
    def staging(self) -> Staging:
        """Page-locked memory for copies of large arrays."""
        return Staging(self.queue)

    def is_staged(self, size: int) -> bool:
        """Return True if an array of `size` bytes is copied through `staging`: large arrays, not on CPUs."""
        return size >= _STAGED and not self.processor

    @property
    def _is_pocl(self) -> bool:
        """True for PoCL, which caches its kernels itself, for each work-group size.

        Reading a program's binary would make PoCL build all kernels again, for any group size. On some CPUs
        PoCL calls functions that other drivers inline; see kernels/device/pocl_inline.cl.
        """
        return bool(self.device.platform.name == "Portable Computing Language")

    def kernels(self, source: str | Source, *names: str, options: Sequence[str] = ()) -> list[Kernel]:
        """Build a program from files of kernels/ and device structs; return the named kernels.

        Programs and kernels are cached, since creating a kernel is slow.
        """
        key, program = self._program(source, options)
        for name in names:
            if (key, name) not in self._kernels:
                self._kernels[key, name] = Kernel(program, name, self.device)
        return [self._kernels[key, name] for name in names]

    def beside(self, source: Source, name: str, options: Sequence[str] = ()) -> SideQueue:
        """Return a kernel on a side queue, which another thread starts during the bake."""
        _, program = self._program(source, options)
        return SideQueue(self._queue_beside, Kernel(program, name, self.device))

    def _program(self, source: str | Source, options: Sequence[str]) -> tuple[ProgramParts, cl.Program]:
        """Return the parts of a program, which identify it, and the program."""
        parts = (source,) if isinstance(source, str) else source
        key = parts, tuple(options)
        if key not in self._built:
            self._built[key] = self._programs.build(self._text(parts), options)
        return key, self._built[key]

    @cached_property
    def _queue_beside(self) -> cl.CommandQueue:
        return cl.CommandQueue(self.context)

    def build_ahead(self, programs: Iterable[PlannedProgram]) -> None:
        """Start to build programs for this kind of device in other processes, each once.

        The results are binaries of a GPU, or kernels that PoCL caches for a CPU.
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
        """Build the programs for direct light that `build_ahead` left to this process; yield after each."""
        while self._own:
            self._program(*self._own.pop(0))
            yield

    def preparation(self, early: bool = False) -> Preparation | None:
        """Return the progress of the builds of `build_ahead`; None once they have ended.

        early:  True to wait only for the programs that direct light needs
        """
        left = self._programs.preparation(self._early if early else self._planned)
        if left is None and not early:
            self._programs.keep_pace()
        return left

    @property
    def is_preparing(self) -> bool:
        """True on a CPU while other processes build the programs of `build_ahead`."""
        return self.processor and self._programs.preparation(self._planned) is not None

    def release(self) -> None:
        """End the tasks of the device's thread and the builds of programs in other processes."""
        self.thread.end()
        self._programs.stop()
        self._records.leave()

    def _text(self, parts: Source) -> str:
        return program_source((*self._prelude, *parts))

    def slice_size(self, kernel: Kernel, *work: object, items: int = 1) -> TimeSlicer:
        """Return the slice-size controller of a kernel for some work, adapted by earlier work.

        work:   values that affect the time of an item
        items:  work items that a kernel starts for each item of a slice
        """
        key = (kernel, *work)
        if key not in self._slice_sizes:
            self._slice_sizes[key] = TimeSlicer(slice_limits(self.device, kernel.preferred_items, items))
        return self._slice_sizes[key]

    def run(self, kernel: Kernel, items: int, *arguments: object, layers: int = 1) -> None:
        """Run a kernel for at least `items` work items in each layer; it must ignore the surplus."""
        run_on(self.queue, kernel, items, *arguments, layers=layers)

    def run_texels(self, kernel: Kernel, shape: tuple[int, ...], *arguments: object) -> None:
        """Run a kernel for at least each texel of images, (images, height, width); see texel.cl."""
        images, height, width = shape
        group = kernel.group(ITEMS, 1, 1)
        items = (-(-width // group[0]) * group[0], height, images)
        kernel(self.queue, items, group, *arguments, np.int32(width), np.int32(height))

    def _first_working_context(self, devices: list[cl.Device]) -> cl.Context:
        """Return a context of the first device that builds a kernel.

        A PoCL that is older than its CPU is listed but cannot build any kernel. The first device is tried
        twice if builder processes use it, since they may hold memory that it lacks.
        """
        failures: dict[str, str] = {}
        for device in [devices[0], *devices] if self._begun else devices:
            try:
                context = self._context_of(device)
                self._replacements = needed_replacements(context)
                return context
            except cl.Error as error:
                self.release()
                version = device.platform.version.strip()
                failures[f"{device.name.strip()} ({version})"] = _reason(error)
        reasons = "; ".join(f"{device}: {reason}" for device, reason in failures.items())
        trouble = f"No OpenCL device can build kernels: {reasons}. {remedy(sys.platform)}"
        raise DeviceError(" ".join((*self.notes, trouble)))


def device_issue(device: cl.Device) -> str:
    """Return the reason why a device cannot build kernels; empty if it can."""
    try:
        needed_replacements(cl.Context([device]))
    except cl.Error as error:
        return _reason(error)
    return ""


def device_name(device: cl.Device) -> str:
    """Return the name of a device for the settings: platform and device name."""
    return f"{device.platform.name.strip()}: {device.name.strip()}"


def _chosen(devices: list[cl.Device], name: str | None) -> list[cl.Device]:
    """Return the devices with a name, or all if the name is None; several platforms may offer one name."""
    chosen = [device for device in devices if name in (None, device_name(device))]
    if not chosen:
        offered = ", ".join(f"'{known}'" for known in dict.fromkeys(map(device_name, devices)))
        raise DeviceError(
            f"There is no OpenCL device '{name}'. Choose one of {offered} in Hemibake's preferences, "
            "or leave the field empty for the best device."
        )
    return chosen


def _usable(
    devices: list[cl.Device], chosen: str | None, records: DeviceRecords
) -> tuple[list[cl.Device], tuple[str, ...]]:
    """Return the devices that bakes do not skip, and sentences about skipped ones.

    chosen: name of the device that the user has chosen, which is never skipped

    Raises DeviceError if no device is left.
    """
    skipped = {} if chosen else records.skipped()
    if not skipped:
        return devices, ()
    digests = [device_digest(device) for device in devices]
    notes = tuple(dict.fromkeys(skipped[digest] for digest in digests if digest in skipped))
    usable = [device for device, digest in zip(devices, digests, strict=True) if digest not in skipped]
    if not usable:
        raise DeviceError(" ".join(("No OpenCL device works.", *notes)))
    return usable, notes


def found_devices() -> list[cl.Device]:
    """Return all devices, best kind first: GPUs, accelerators, others.

    Within a kind, devices of a vendor's driver precede devices of Mesa's.
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


def search_devices(records: DeviceRecords, chosen: str | None) -> list[cl.Device]:
    """Return `found_devices`, recorded so that a driver that crashes on its start is started only once.

    chosen:  name of the device that the user has chosen, for which drivers are started again

    Raises DeviceError after such a crash.
    """
    crashed = records.skipped().get(SEARCH.digest)
    if crashed and chosen is None:
        raise DeviceError(crashed)
    records.use(SEARCH)
    try:
        return found_devices()
    finally:
        records.leave()


def _rank(device: cl.Device) -> tuple[int, bool]:
    kinds = (cl.device_type.GPU, cl.device_type.ACCELERATOR)
    kind = next((rank for rank, kind in enumerate(kinds) if device.type & kind), len(kinds))
    return kind, device.platform.name.strip().lower() in _MESA_PLATFORMS


def _reason(error: cl.Error) -> str:
    """Return the most informative line of an OpenCL error."""
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    return next((line for line in lines if "error:" in line.lower()), lines[0])


def remedy(system: str) -> str:
    """Return the remedy for a missing OpenCL device on a system, named as in `sys.platform`."""
    driver = "Install the current driver of your GPU"
    if system == "linux":
        return (
            f"{driver}, or PoCL, which computes on the CPU: on Debian or Ubuntu "
            "apt install pocl-opencl-icd, on Fedora dnf install pocl, on Arch pacman -S pocl."
        )
    return "OpenCL is part of macOS; update the system." if system == "darwin" else f"{driver}."
