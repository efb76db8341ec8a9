"""Errors a person can act on: each message names the cause and the remedy."""


class EngineError(Exception):
    """Base of every error the engine raises on purpose."""


class SceneError(EngineError):
    """The scene cannot be baked as it is; the message names the object."""


class OverlapError(SceneError):
    """Lightmap UVs lie on each other."""


class SettingsError(EngineError):
    """A setting is out of its range; the message names the setting and the range."""


class DeviceError(EngineError):
    """No usable OpenGL or OpenCL device; the message says what to install."""


class DeviceMemoryError(DeviceError):
    """The memory of a device is full; the message says of which."""


class DenoiseError(EngineError):
    """Open Image Denoise is not there, or failed; lightmaps stay as they were baked."""


class PatchFileError(EngineError):
    """A patch file is truncated, damaged, foreign or of another version."""


class WorkerError(EngineError):
    """The worker process could not be started, or died in the middle of a bake."""
