"""What a block of patches holds on the device of a worker."""

import gc
import weakref

from engine import Settings
from engine.cluster.block import find
from engine.cluster.shipment import Shipment
from tests.analytic.scenes import nine_quad_room


def test_samples_go_with_their_block_at_once():
    settings = Settings(resolution=19, samples=16, visibility="rays")
    block = find(Shipment.of(nine_quad_room(), settings, local=True), 3, 50, None)
    samples = weakref.ref(block._gather._sweep._kept)
    gc.disable()
    try:
        del block
        assert samples() is None
    finally:
        gc.enable()
