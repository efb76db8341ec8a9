"""Records about OpenCL devices in the cache folder: devices in use, skipped and tested devices.

A driver may crash or compute wrong light. Bakes then skip this version of the driver, unless the user chooses
the device by its name.
"""

from __future__ import annotations

import os
import time
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

from ..json_file import read_json, write_json

#: Files of the device that each process uses, of skipped devices, and of devices whose light was tested.
_USED, _SKIPPED, _TESTED = "device_of_{}.json", "skipped_devices.json", "tested_devices.json"

#: Age in seconds after which the record of a process counts as left over (chosen).
_OLD = 86_400


class DeviceKey(NamedTuple):
    """A device with one version of its driver.

    digest:  see `program_cache.device_digest`
    name:    as in `Settings.opencl_device`
    """

    digest: str
    name: str


#: Key of the search for devices, in which every driver starts.
SEARCH = DeviceKey("search", "OpenCL")

#: Sentence about a crash in that search.
_CRASHED_SEARCH = (
    "An OpenCL driver crashed when it was started, so bakes use OpenGL instead. Update or remove the driver, "
    "then clear the cache in Hemibake's preferences."
)


class DeviceRecords:
    """Records in a folder; None for no records. A damaged file counts as missing."""

    def __init__(self, folder: str | None) -> None:
        self._folder = None if folder is None else Path(folder)

    def use(self, device: DeviceKey) -> None:
        """Record the device that this process uses; remove old records."""
        self._remove_old()
        self._write(_USED.format(os.getpid()), {device.digest: device.name})

    def leave(self, process: int | None = None) -> DeviceKey | None:
        """Remove the record of a process, by default of this one; return the device that it used."""
        name = _USED.format(os.getpid() if process is None else process)
        used = self._read(name)
        if self._folder is not None:
            with suppress(OSError):
                (self._folder / name).unlink()
        return next((DeviceKey(*item) for item in used.items()), None)

    def skipped(self) -> dict[str, str]:
        """Return a sentence about each skipped device, by digest."""
        return self._read(_SKIPPED)

    def skip(self, device: DeviceKey, issue: str) -> None:
        """Let bakes skip a device, or all devices after a crash of `SEARCH`.

        issue:  predicate of a sentence whose subject is the driver
        """
        sentence = (
            f"'{device.name}': its driver {issue}, so bakes skip this driver version. "
            "Update the driver, or choose the device in Hemibake's preferences to use it anyway."
        )
        sentence = _CRASHED_SEARCH if device == SEARCH else sentence
        self._write(_SKIPPED, {**self.skipped(), device.digest: sentence})

    def allow(self, device: DeviceKey) -> None:
        """Let bakes use a device again."""
        self._write(_SKIPPED, {key: text for key, text in self.skipped().items() if key != device.digest})

    def is_tested(self, device: DeviceKey) -> bool:
        """Return True if a device has passed the light test."""
        return device.digest in self._read(_TESTED)

    def keep_tested(self, device: DeviceKey) -> None:
        """Record that a device has passed the light test."""
        self._write(_TESTED, {**self._read(_TESTED), device.digest: device.name})

    def _remove_old(self) -> None:
        """Remove old records of processes that have crashed."""
        with suppress(OSError):
            for path in self._folder.glob(_USED.format("*")) if self._folder else ():
                if time.time() - path.stat().st_mtime > _OLD:
                    path.unlink()

    def _read(self, name: str) -> dict[str, str]:
        """Return the texts of a file."""
        texts = read_json(self._folder and self._folder / name).items()
        return {key: text for key, text in texts if isinstance(text, str)}

    def _write(self, name: str, texts: dict[str, str]) -> None:
        """Write a file of texts; ignore errors of the file system."""
        if self._folder is None:
            return
        with suppress(OSError):
            write_json(self._folder / name, texts)
