"""Layout of hemicubes in a texture array."""

from __future__ import annotations

from dataclasses import dataclass

from ...errors import SettingsError
from ...settings import Settings

#: Limits of OpenGL 4.1: viewports, array layers, and texture size.
_VIEWPORTS = 16
_LAYERS = 2048
_TEXTURE_SIZE = 16384

#: Maximum number of hemicubes per draw call, since each of the five faces needs a viewport.
TILES_PER_DRAW = _VIEWPORTS // 5

#: Bytes of device memory per hemicube texel: for radiance, color (RGBA32F) and depth. With OpenCL, copy and
#: work buffer are added. Item buffers take ID, copy, cache entry and depth.
RADIANCE_BYTES = 16 + 4
COPIED_RADIANCE_BYTES = 16 + 16 + 16 + 4
IDENTITY_BYTES = 4 + 4 + 4 + 4


@dataclass(frozen=True)
class Tiles:
    """Texture array of `layers` layers with `rows` x `columns` hemicubes of width n.

    Slots count along rows, then over rows, then over layers.
    """

    n: int
    columns: int
    rows: int
    layers: int

    @property
    def width(self) -> int:
        """Width of the array, texels."""
        return self.columns * self.n

    @property
    def height(self) -> int:
        """Height of the array, texels."""
        return self.rows * 3 * self.n

    @property
    def per_layer(self) -> int:
        """Number of hemicubes in a layer."""
        return self.columns * self.rows

    @property
    def capacity(self) -> int:
        """Number of hemicubes in the array."""
        return self.per_layer * self.layers

    def origin(self, tile: int) -> tuple[int, int]:
        """Return the texel (x, y) of the lower left corner of a tile within its layer."""
        row, column = divmod(tile, self.columns)
        return column * self.n, row * 3 * self.n


def plan_tiles(settings: Settings, patches: int, texel_bytes: int = COPIED_RADIANCE_BYTES) -> Tiles:
    """Choose the texture array of a bake for a number of patches.

    Without `settings.array_size`, a layer holds as many hemicubes as one draw call can fill, so a batch takes
    a single draw. texel_bytes: memory per hemicube texel. Raises SettingsError if array_size holds no
    hemicube.
    """
    n = settings.hemicube
    if not any(settings.array_size):
        layer_bytes = TILES_PER_DRAW * 3 * n * n * texel_bytes
        layers = max(1, settings.batch_bytes // layer_bytes)
        needed = -(-patches // TILES_PER_DRAW)
        return Tiles(n, TILES_PER_DRAW, 1, min(layers, needed, _LAYERS))
    width, height, layers = settings.array_size
    columns, rows = width // n, height // (3 * n)
    limit = _TEXTURE_SIZE // max(1, columns * rows)
    if min(columns, rows, layers) < 1 or max(width, height) > _TEXTURE_SIZE or layers > min(_LAYERS, limit):
        raise SettingsError(
            f"array_size is {settings.array_size}; a hemicube of width {n} needs at least {n} x {3 * n} x 1 "
            f"texels, and at most {_TEXTURE_SIZE} hemicubes fit into one array."
        )
    return Tiles(n, columns, rows, layers)
