from types import SimpleNamespace

import numpy as np
import pytest

from engine.errors import SettingsError
from engine.plan.limits import check_limits
from engine.scene.model import Scene
from engine.settings import Settings

GRAPHICS = SimpleNamespace(
    name="Card",
    context=SimpleNamespace(info={"GL_MAX_TEXTURE_SIZE": 4096, "GL_MAX_ARRAY_TEXTURE_LAYERS": 256}),
)


def check(atlases, resolution, memory, unified):
    """Check lightmaps against a device with so many bytes, its own or the host's."""
    device = SimpleNamespace(global_mem_size=memory, host_unified_memory=unified)
    compute = SimpleNamespace(name="Card", device=device)
    scene = Scene((), (), tuple(f"Atlas {i}" for i in range(atlases)), np.zeros(3))
    check_limits(GRAPHICS, compute, scene, Settings(resolution=resolution, batch_bytes=1))


@pytest.mark.parametrize(("unified", "fixed", "each"), [(False, 32, 4), (True, 64, 12)])
@pytest.mark.parametrize("atlases", [1, 8])
def test_one_atlas_is_listed_at_a_time_and_all_have_index_maps(atlases, unified, fixed, each):
    needed = 2048**2 * (fixed + each * atlases) + 1
    check(atlases, 2048, needed, unified)
    with pytest.raises(SettingsError, match="lightmaps of 2048 x 2048 texels need .* GiB; 'Card' has"):
        check(atlases, 2048, needed - 1, unified)


def test_more_or_larger_lightmaps_than_the_driver_holds():
    with pytest.raises(SettingsError, match="The scene has 257 lightmaps.*at most 256[.] Put objects into"):
        check(257, 64, 1 << 40, False)
    with pytest.raises(SettingsError, match="resolution is 8192; 'Card' draws at most 4096 texels"):
        check(1, 8192, 1 << 40, False)
