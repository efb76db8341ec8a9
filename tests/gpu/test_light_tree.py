"""Light tree: emitters are chosen with the right frequency, without a visit of all of them."""

import numpy as np
import pyopencl as cl
import pytest

from engine.device.cl_device import ComputeDevice
from engine.device.source import program_source
from engine.direct.emitters import EMITTER, NO_CONE, POINT
from engine.direct.light_tree import LIGHT_TREE_RECORDS, build_light_tree
from engine.visibility.rays.receiver_records import RECEIVER

#: Counts what patches look at, and how often emitters are chosen; the widths are summed up, too.
COUNTING = """
__kernel void looked_at(__global const ReceiverRecord *receivers, __global const Emitter *emitters,
                        __global const LightNode *nodes, const int root,
                        __global int *counts)
{
    const Receiver r = load_receiver(receivers + get_global_id(0));
    const Lights lights = {emitters, nodes, 0.0f, {0, 0}};
    int stack[TREE_STACK], depth = 0, code = root, count = 0;
    for (;;) {
        bool open;
        weight_of(&lights, code, &r, &open);
        ++count;
        if (open) {
            stack[depth++] = nodes[code].children[1];
            code = nodes[code].children[0];
        } else if (depth > 0) {
            code = stack[--depth];
        } else {
            break;
        }
    }
    counts[get_global_id(0)] = count;
}

__kernel void chosen(__global const ReceiverRecord *receivers, __global const Emitter *emitters,
                     __global const LightNode *nodes, const int root,
                     const int budget, const int seeds, __global float2 *drawn)
{
    const Receiver r = load_receiver(receivers);
    const Lights lights = {emitters, nodes, 0.0f, {0, 0}};
    for (int seed = 0; seed < seeds; ++seed) {
        Walk walk;
        start_walk(&walk, &lights, root, &r, budget);
        float2 span = (float2)(0.0f);
        int emitter = -1;
        for (int index = 0; index < budget; ++index) {
            const float sample = index + (seed + 0.5f) / seeds;
            if (sample >= span.x)
                emitter = next_emitter(&walk, &lights, &r, sample, &span);
            if (emitter >= 0)
                drawn[emitter] += (float2)(1.0f / seeds, 1.0f / (span.y * seeds));
        }
    }
}
"""


@pytest.fixture(scope="module")
def device():
    return ComputeDevice()


@pytest.fixture(scope="module")
def counting(device):
    source = program_source((*LIGHT_TREE_RECORDS, "light_tree.cl")) + COUNTING
    return cl.Program(device.context, source).build()


def lamps(count, seed=0):
    """Return records of points near the ceiling of a hall 40 x 40 x 4 m."""
    rng = np.random.default_rng(seed)
    return EMITTER.array(
        count,
        kind=POINT,
        luminance=rng.uniform(1, 3, count),
        casts_shadow=1,
        position=rng.uniform((0, 0, 3), (40, 40, 3.9), (count, 3)),
        cos_half_angle=NO_CONE,
    )


def receivers(count, seed=1):
    """Return records of texels of the floor, 2 cm wide."""
    at, up = np.zeros((count, 3)), (0, 0, 1)
    at[:, :2] = np.random.default_rng(seed).uniform(0, 40, (count, 2))
    return RECEIVER.array(count, at=at, normal=up, geometric=up, edge_u=(0.02, 0, 0), edge_v=(0, 0.02, 0))


def buffers(device, *arrays):
    flags = cl.mem_flags.READ_ONLY | cl.mem_flags.COPY_HOST_PTR
    return [cl.Buffer(device.context, flags, hostbuf=np.ascontiguousarray(array)) for array in arrays]


def looked_at(device, counting, count):
    """Return at how many nodes and emitters patches look to weigh all of `count` lamps, mean."""
    records, patches = lamps(count), receivers(256)
    tree, counts = build_light_tree(records), np.zeros(256, np.int32)
    arguments = buffers(device, patches, records, tree.nodes)
    out = cl.Buffer(device.context, cl.mem_flags.WRITE_ONLY, counts.nbytes)
    cl.Kernel(counting, "looked_at")(device.queue, (256,), None, *arguments, np.int32(tree.root), out)
    cl.enqueue_copy(device.queue, counts, out)
    return counts.mean()


def test_work_grows_as_the_logarithm_of_the_number_of_lamps(device, counting):
    work = {count: looked_at(device, counting, count) for count in (10, 1000, 10_000, 100_000)}
    assert work[1000] < 500
    assert work[100_000] < 2.5 * work[1000]


@pytest.mark.parametrize("budget", [1, 8, 512])
def test_emitters_are_chosen_as_often_as_their_interval_is_wide(device, counting, budget):
    """So the mean of 1 / width over all seeds is 1 for each emitter: what it brings is counted once."""
    records, seeds = lamps(300), 200_000 // budget
    tree, drawn = build_light_tree(records), np.zeros((300, 2), np.float32)
    arguments = buffers(device, receivers(1), records, tree.nodes)
    out = cl.Buffer(device.context, cl.mem_flags.READ_WRITE | cl.mem_flags.COPY_HOST_PTR, hostbuf=drawn)
    sizes = map(np.int32, (tree.root, budget, seeds))
    cl.Kernel(counting, "chosen")(device.queue, (1,), None, *arguments, *sizes, out)
    cl.enqueue_copy(device.queue, drawn, out)
    assert drawn[:, 0].sum() == pytest.approx(budget, rel=1e-3)
    chosen = drawn[:, 0] * seeds > 50
    assert chosen.mean() > 0.5
    assert drawn[chosen, 1] == pytest.approx(1, rel=0.05)
