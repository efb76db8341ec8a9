// Identity hemicubes: each texel names the patch that is seen, plus 1 (0: none), with the highest bit set
// for its back; or the surroundings. They are drawn once and summed in every iteration.

#define BACK 0x80000000u
#define SKY 0x7FFFFFFFu

// Where texel (x, y) of a hemicube is in a texture array of `rows` x `columns` hemicubes of 3n x n a layer.
size_t texel_of(const int slot, const int x, const int y, const int columns, const int rows, const int n)
{
    const int layer_row = slot / columns;
    return ((size_t)layer_row * 3 * n + y) * columns * n + (slot % columns) * n + x;
}

float4 sum_of_group(float4 value, __local float4 *partial)
{
    const int item = get_local_id(0);
    partial[item] = value;
    barrier(CLK_LOCAL_MEM_FENCE);
    for (int step = get_local_size(0) / 2; step > 0; step /= 2) {
        if (item < step)
            partial[item] += partial[item + step];
        barrier(CLK_LOCAL_MEM_FENCE);
    }
    return partial[0];
}

// What stays the same: rgb of the surroundings and of the backs' emission, and in a the share of the
// hemisphere that is no back. In `cache` only the fronts are left; everything else becomes 0, no patch.
__kernel void fixed(__global const uint *hemicubes, __global uint *cache, __global const float *multiplier,
                    __global const float4 *frames, __global const float4 *emission,
                    __global const float4 *sky, const int sky_width, const int sky_height,
                    __global float4 *fixed_light, const int columns, const int rows, const int n,
                    __local float4 *partial)
{
    const int slot = get_group_id(0);
    __global const float4 *frame = frames + 4 * slot;
    float4 sum = (float4)(0.0f);
    for (int i = get_local_id(0); i < 3 * n * n; i += get_local_size(0)) {
        const int x = i % n, y = i / n;
        const size_t texel = texel_of(slot, x, y, columns, rows, n);
        const float3 direction = texel_direction(x, y, n);
        const uint seen = hemicubes[texel];
        uint front = 0;
        if (dot(direction, frame[3].xyz) > 0.0f) {
            const float weight = multiplier[i];
            if (seen == SKY) {
                const float3 world = direction.x * frame[0].xyz + direction.y * frame[1].xyz + direction.z * frame[2].xyz;
                sum += weight * (float4)(surroundings(world, sky, (int2)(sky_width, sky_height)).xyz, 1.0f);
            } else if (seen & BACK) {
                sum += weight * (float4)(emission[seen & ~BACK].xyz, (seen & ~BACK) ? 0.0f : 1.0f);
            } else {
                sum.w += weight;
                front = seen;
            }
        }
        cache[texel] = front;
    }
    sum = sum_of_group(sum, partial);
    if (get_local_id(0) == 0)
        fixed_light[slot] = sum;
}

// One iteration: the fronts' radiance, weighted and added to what stays the same.
__kernel void gather(__global const uint *cache, __global const float *multiplier,
                     __global const float4 *radiance, __global const float4 *fixed_light,
                     __global float4 *irradiance, const int columns, const int rows, const int n,
                     __local float4 *partial)
{
    const int slot = get_group_id(0);
    float4 sum = (float4)(0.0f);
    for (int i = get_local_id(0); i < 3 * n * n; i += get_local_size(0))
        sum += multiplier[i] * radiance[cache[texel_of(slot, i % n, i / n, columns, rows, n)]];
    sum = sum_of_group(sum, partial);
    if (get_local_id(0) == 0)
        irradiance[slot] = sum + fixed_light[slot];
}
