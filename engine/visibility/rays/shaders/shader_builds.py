"""Record of slow shaders that a driver has built, in the cache folder; the driver itself caches programs."""

from __future__ import annotations

import math
from contextlib import suppress
from pathlib import Path

from ....device.gl_context import GraphicsContext
from ....json_file import read_json, write_json

#: File of the seconds of each build, by driver and shader.
_BUILT = "shader_builds.json"

#: Guessed seconds of a build before any was measured. The shader of direct light takes llvmpipe 2.7 CPU s
#: with Mesa 22.3 and 9.9 CPU s with Mesa 25.0.
_GUESS = 8.0


class ShaderBuilds:
    """Durations of shader builds, in a file of the cache folder. A damaged file counts as missing.

    folder:    cache folder; if None, nothing is recorded and all shaders count as built
    graphics:  context whose driver builds the shaders
    """

    def __init__(self, folder: str | None, graphics: GraphicsContext) -> None:
        self._path = None if folder is None else Path(folder) / _BUILT
        self._driver = f"{graphics.name}, {graphics.context.info['GL_VERSION']}"

    def has(self, shader: str) -> bool:
        """Return True if this driver has built a shader.

        shader:  digest of its source
        """
        return self._path is None or shader in self._known()

    @property
    def expected_seconds(self) -> float:
        """Expected duration of a build, s: the longest one of this driver, else a guess."""
        return max(self._known().values(), default=_GUESS)

    def keep(self, shader: str, seconds: float) -> None:
        """Record the duration of a build, s."""
        if self._path is None:
            return
        known = {**self._known(), shader: seconds}
        with suppress(OSError):
            write_json(self._path, {**read_json(self._path), self._driver: known})

    def _known(self) -> dict[str, float]:
        """Return the duration of each build by this driver, s, by digest of the shader."""
        known = read_json(self._path).get(self._driver)
        if not isinstance(known, dict):
            return {}
        return {
            name: value for name, value in known.items() if isinstance(value, float) and math.isfinite(value)
        }
