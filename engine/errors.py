"""Errors that the user can fix: each message names the cause and the remedy."""


class EngineError(Exception):
    """Base class of all errors that the engine raises deliberately."""


class SceneError(EngineError):
    """Invalid scene; the message names the object."""


class OverlapError(SceneError):
    """Lightmap UVs that overlap; the message names the objects."""


class SettingsError(EngineError):
    """Setting out of range; the message names the setting and the range."""


class DeviceError(EngineError):
    """Missing OpenGL or OpenCL device; the message names what to install."""


class DeviceMemoryError(DeviceError):
    """Out of device memory; the message names the device."""


class DenoiseError(EngineError):
    """Missing or failed Open Image Denoise; the lightmaps stay noisy."""


class PatchFileError(EngineError):
    """Patch file that is truncated, damaged, of another scene, or of another version."""


class WorkerError(EngineError):
    """Worker process that could not start or that died during a bake."""


class WorkerCrashError(WorkerError):
    """Worker process that crashed, as drivers do.

    process: its identifier
    """

    process = 0
