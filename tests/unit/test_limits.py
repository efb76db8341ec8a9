from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from engine.errors import SettingsError
from engine.patches.patch_materials import PatchMaterials
from engine.plan.limits import check_limits, check_patches, may_gather
from engine.scene.model import Scene
from engine.settings import Settings

GRAPHICS = SimpleNamespace(
    name="Card",
    context=SimpleNamespace(info={"GL_MAX_TEXTURE_SIZE": 4096, "GL_MAX_ARRAY_TEXTURE_LAYERS": 256}),
)


def check(atlases, resolution, memory, unified):
    """Check lightmaps against a device with so many bytes, its own or the host's."""
    device = SimpleNamespace(global_mem_size=memory, host_unified_memory=unified)
    compute = SimpleNamespace(name="Card", device=device, processor=unified)
    scene = Scene((), (), tuple(f"Atlas {i}" for i in range(atlases)), np.zeros(3))
    check_limits(GRAPHICS, compute, scene, Settings(resolution=resolution, batch_bytes=1))


@pytest.mark.parametrize(("unified", "fixed", "each"), [(False, 32, 4), (True, 64, 12)])
@pytest.mark.parametrize("atlases", [1, 8])
def test_one_atlas_is_listed_at_a_time_and_all_have_index_maps(atlases, unified, fixed, each):
    needed = 2048**2 * (fixed + each * atlases) + 1
    check(atlases, 2048, needed, unified)
    with pytest.raises(SettingsError, match="lightmaps of 2048 x 2048 texels need .* GiB; 'Card' has"):
        check(atlases, 2048, needed - 1, unified)


@pytest.mark.parametrize("gathers", [True, False])
@pytest.mark.parametrize(("processor", "of_triangle", "of_texel"), [(False, 72, 192), (True, 332, 236)])
@pytest.mark.parametrize(("used", "uploaded"), [(4_000_001, 13_000_001), (3_000_001, 3_000_001)])
def test_triangles_and_texels_that_cannot_fit_are_refused(
    processor, of_triangle, of_texel, gathers, used, uploaded
):
    def check_memory(size):
        device = SimpleNamespace(global_mem_size=size)
        compute = SimpleNamespace(name="Card", device=device, processor=processor)
        check_patches(compute, 13_000_001, used, 61_000_003, gathers)

    needed = 13_000_001 * of_triangle + uploaded * 120 + 61_000_003 * (of_texel - 48 * (not gathers))
    check_memory(needed)
    with pytest.raises(SettingsError, match="13,000,001 triangles and 61,000,003 texels need .* Lower the"):
        check_memory(needed - 1)


def test_only_scenes_in_which_light_may_be_gather_it():
    dark, light = np.zeros((2, 3), np.float32), np.float32([[0, 0, 0], [0, 0.1, 0]])
    black = Scene((), (), ("Atlas",), np.zeros(3))
    surfaces = PatchMaterials(dark, dark)
    assert not may_gather(black, surfaces, Settings(outputs=("combined",)))
    assert may_gather(black, surfaces, Settings(outputs=("combined", "ambient_occlusion")))
    assert may_gather(replace(black, world=light[1]), surfaces, Settings())
    assert may_gather(replace(black, lights=(None,)), surfaces, Settings())
    assert may_gather(black, replace(surfaces, emission=light), Settings())
    assert may_gather(black, replace(surfaces, back_emission=light), Settings())


def test_more_texels_than_radiosity_textures_hold_are_refused():
    check_patches(None, 1, 1, 2**26 - 2)
    with pytest.raises(SettingsError, match="hold 67,108,863 texels; at most 67,108,862 can .* Lower the"):
        check_patches(None, 1, 1, 2**26 - 1)


def test_a_scene_whose_triangles_cannot_fit_is_refused_before_texels_are_listed():
    device = SimpleNamespace(global_mem_size=72 * 300 - 1, host_unified_memory=False)
    compute = SimpleNamespace(name="Card", device=device, processor=False)
    meshes = tuple(SimpleNamespace(positions=np.zeros((count, 3, 3))) for count in (101, 199))
    scene = Scene(meshes, (), ("Atlas",), np.zeros(3))
    with pytest.raises(SettingsError, match="300 triangles need at least .*'Card' has .* Lower the"):
        check_limits(GRAPHICS, compute, scene, Settings(resolution=1, batch_bytes=1))


def test_more_or_larger_lightmaps_than_the_driver_holds():
    with pytest.raises(SettingsError, match="The scene has 257 lightmaps.*at most 256[.] Put objects into"):
        check(257, 64, 1 << 40, False)
    with pytest.raises(SettingsError, match="resolution is 8192; 'Card' draws at most 4096 texels"):
        check(1, 8192, 1 << 40, False)
