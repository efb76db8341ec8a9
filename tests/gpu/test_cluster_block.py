"""Memory of a block of patches on a worker's device."""

import gc
import weakref

from engine import Settings
from engine.cluster.block import find
from engine.cluster.patch_rows import PatchRows
from engine.cluster.patch_table import SceneTable
from engine.cluster.scene_payload import ScenePayload
from engine.direct.emitter_split import split_light
from engine.plan.session_cache import SessionCache
from tests.analytic.scenes import nine_quad_room


def test_samples_go_with_their_block_at_once(graphics, compute):
    settings, scene = Settings(resolution=19, samples=16, visibility="rays"), nine_quad_room()
    patch_scene = SessionCache().make_patch_scene(graphics, compute, scene, settings)
    table = SceneTable.of_scene(
        patch_scene, split_light(scene.world, patch_scene, settings).bright, False, ""
    )
    rows = PatchRows.of(patch_scene.patches, "").part(3, 50)
    block = find(ScenePayload.of(scene, settings, local=True), table, rows)
    samples = weakref.ref(block.found._gather._sweep._kept)
    gc.disable()
    try:
        del block
        assert samples() is None
    finally:
        gc.enable()
