#include "hemicube_directions.cl"
#include "visibility_sample.cl"

// Compacts rasterised hemicube item buffers (a texture array) into rows of the visibility cache: one entry ID per
// hemicube texel.

// Returns the index of texel (x, y) of a hemicube in a texture array whose layers hold `rows` x `columns` hemicubes of
// n x 3n texels.
size_t texel_of(const int slot, const int x, const int y, const int columns, const int n)
{
    const int layer_row = slot / columns;
    return ((size_t)layer_row * 3 * n + y) * columns * n + (slot % columns) * n + x;
}

// Encodes the item buffer of one patch per work group, and sums emission of back faces. Texels below the geometric
// horizon store 0.
__kernel void compact_item_buffer(__global const uint *hemicubes, __global const float *multiplier,
                                  __global const Frame *frames, __global const float4 *emission, const uint outside,
                                  const int columns, const int n, const int first, const int cached_from,
                                  __global Front *cache, __global float4 *back_light, __global float *patches_seen,
                                  __global uchar *backs_seen, __global float4 *back_l1, __local float4 *partial)
{
    const int slot = get_group_id(0), samples = 3 * n * n;
    __global const Frame *frame = frames + slot;
    const float3 right = vload3(0, frame->right), up = vload3(0, frame->up), normal = vload3(0, frame->normal);
    const float3 horizon = vload3(0, frame->horizon);
    ViewSum sum = {(float4)(0.0f)};
    for (int i = get_local_id(0); i < samples; i += get_local_size(0)) {
        const int x = i % n, y = i / n;
        const float3 d = texel_direction(x, y, n);
        uint kept = 0;
        if (dot(d, horizon) > 0.0f) {
            const float3 world = d.x * right + d.y * up + d.z * normal;
            kept = encode_sample(hemicubes[texel_of(slot, x, y, columns, n)], 0, multiplier[i], world, normal, emission,
                                 backs_seen, outside, 0, &sum);
        }
        cache[(size_t)(first + slot - cached_from) * samples + i] = kept;
    }
    store_view(&sum, first + slot, back_light, patches_seen, back_l1, partial);
}
