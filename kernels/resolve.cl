// Identity hemicubes that were drawn into a texture array become rows of patch numbers.

// Where texel (x, y) of a hemicube is in a texture array of `rows` x `columns` hemicubes of 3n x n a layer.
size_t texel_of(const int slot, const int x, const int y, const int columns, const int n)
{
    const int layer_row = slot / columns;
    return ((size_t)layer_row * 3 * n + y) * columns * n + (slot % columns) * n + x;
}

// One hemicube a group; frames hold right, up, normal and the horizon of each.
__kernel void resolve(__global const uint *hemicubes, __global const float *multiplier,
                      __global const float4 *frames, __global const float4 *emission,
                      __global const float4 *sky, const int sky_width, const int sky_height,
                      const int columns, const int n, const int first, const int cached_from,
                      __global Front *cache, __global float4 *static_light, __global float *patches_seen,
                      __local float4 *partial)
{
    const int slot = get_group_id(0), samples = 3 * n * n;
    __global const float4 *frame = frames + 4 * slot;
    ViewSum sum = {(float4)(0.0f), 0.0f};
    for (int i = get_local_id(0); i < samples; i += get_local_size(0)) {
        const int x = i % n, y = i / n;
        const float3 d = texel_direction(x, y, n);
        uint front = 0;
        if (dot(d, frame[3].xyz) > 0.0f) {
            const float3 world = d.x * frame[0].xyz + d.y * frame[1].xyz + d.z * frame[2].xyz;
            front = count_sample(hemicubes[texel_of(slot, x, y, columns, n)], multiplier[i], world, emission,
                                 sky, (int2)(sky_width, sky_height), &sum);
        }
        cache[(size_t)(first + slot - cached_from) * samples + i] = front;
    }
    store_view(sum, first + slot, static_light, patches_seen, partial);
}
