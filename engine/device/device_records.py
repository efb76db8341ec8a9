"""Records about OpenCL devices in the cache folder: which process uses which device, and which are skipped.

A driver may crash, or compute wrong light. Bakes then skip this version of it, unless the user chooses the
device by its name.
"""

from __future__ import annotations

import json
import os
import time
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

#: Files of the device that each process uses, of skipped devices, and of devices whose light was tested.
_USED, _SKIPPED, _TESTED = "device_of_{}.json", "skipped_devices.json", "tested_devices.json"


#: Age of records of processes that are removed, s.
_OLD = 86_400


class DeviceKey(NamedTuple):
    """A device with one version of its driver.

    digest:  see `program_cache.device_digest`
    name:    as in `Settings.opencl_device`
    """

    digest: str
    name: str


class DeviceRecords:
    """Records in a folder; without a folder nothing is recorded. A damaged file counts as none."""

    def __init__(self, folder: str | None) -> None:
        self._folder = None if folder is None else Path(folder)

    def use(self, device: DeviceKey) -> None:
        """Record that this process uses a device from now on; remove old records."""
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

    def skip(self, device: DeviceKey, trouble: str) -> None:
        """Have bakes skip a device; trouble: what is wrong, as the end of a sentence about its driver."""
        sentence = (
            f"'{device.name}': its driver {trouble}, so bakes skip this version of it. Update the driver, or "
            "choose the device in Hemibake's preferences to use it all the same."
        )
        self._write(_SKIPPED, {**self.skipped(), device.digest: sentence})

    def unskip(self, device: DeviceKey) -> None:
        """Have bakes use a device again."""
        self._write(_SKIPPED, {key: text for key, text in self.skipped().items() if key != device.digest})

    def is_tested(self, device: DeviceKey) -> bool:
        """Return True if the light of a device was found right."""
        return device.digest in self._read(_TESTED)

    def keep_tested(self, device: DeviceKey) -> None:
        """Record that the light of a device was found right."""
        self._write(_TESTED, {**self._read(_TESTED), device.digest: device.name})

    def _remove_old(self) -> None:
        """Remove records of processes that ended without removing theirs."""
        with suppress(OSError):
            for path in self._folder.glob(_USED.format("*")) if self._folder else ():
                if time.time() - path.stat().st_mtime > _OLD:
                    path.unlink()

    def _read(self, name: str) -> dict[str, str]:
        """Return the texts of a file."""
        if self._folder is None:
            return {}
        with suppress(OSError, ValueError, AttributeError):
            texts = json.loads((self._folder / name).read_text(encoding="utf-8")).items()
            return {str(key): text for key, text in texts if isinstance(text, str)}
        return {}

    def _write(self, name: str, texts: dict[str, str]) -> None:
        """Write a file; a folder that cannot be written stops nothing."""
        if self._folder is None:
            return
        with suppress(OSError):
            self._folder.mkdir(parents=True, exist_ok=True)
            partial = self._folder / f".{name}.{os.getpid()}"
            partial.write_text(json.dumps(texts), encoding="utf-8")
            partial.replace(self._folder / name)
