#include "visibility_sample.cl"

// One iteration: what patches see, known as rows of patch numbers, becomes the light they gather. LIGHT_GROUPS: groups
// of light that gather at once, 1 for all light together; those of a patch lie side by side, so that each number is
// read once.

#define LIGHT_ARGUMENTS __global const float4 *static_light, __global const float4 *direct, \
    __global const float4 *irradiance, __global float4 *gathered, __global float4 *defects, \
    const int column, const int count

// Store a patch's light with its static and its direct light, and the defect: its difference to the last irradiance.
#define STORE(light, patch) do { \
    const float4 all = light + static_light[patch] + direct[patch]; \
    gathered[(size_t)column * count + patch] = all; \
    defects[(size_t)column * count + patch] = all - irradiance[patch]; \
} while (0)

// What four samples bring of a group. EVEN: all samples weigh the same, so that their light is divided in the end.
float4 light_of(__global const float4 *radiance, const Front4 seen, __global const float4 *weights,
                __global const float4 *tints)
{
#ifdef TINTED
#define OF(kept) (radiance[(size_t)ENTRY(kept) * LIGHT_GROUPS] * tints[TINT_INDEX(kept)])
#else
#define OF(entry) radiance[(size_t)(entry) * LIGHT_GROUPS]
#endif
#ifdef EVEN
    return (OF(seen.x) + OF(seen.y)) + (OF(seen.z) + OF(seen.w));
#else
    const float4 weight = *weights;
    return weight.x * OF(seen.x) + weight.y * OF(seen.y) + weight.z * OF(seen.z) + weight.w * OF(seen.w);
#endif
}

// One patch a group of work items, from patch `first` on. Samples are read four at a time, of these fours one in
// `stride`: neighbouring patches begin with different ones. Without EVEN `stride` is 1.
__kernel void gather(__global const Front4 *cache, __global const float4 *multiplier,
                     __global const float4 *radiance, LIGHT_ARGUMENTS, const int quads, const int stride,
                     const int first, __global const float4 *tints, __local float4 *partial)
{
    const int slot = get_group_id(0), begin = (first + slot) % stride;
    __global const Front4 *row = cache + (size_t)slot * quads;
    float4 sums[LIGHT_GROUPS];
#pragma unroll
    for (int group = 0; group < LIGHT_GROUPS; ++group)
        sums[group] = (float4)(0.0f);
    for (int i = begin + stride * get_local_id(0); i < quads; i += stride * get_local_size(0)) {
        const Front4 seen = row[i];
#pragma unroll
        for (int group = 0; group < LIGHT_GROUPS; ++group)
            sums[group] += light_of(radiance + group, seen, multiplier + i, tints);
    }
#pragma unroll
    for (int group = 0; group < LIGHT_GROUPS; ++group) {
        float4 sum = sums[group];
#ifdef EVEN
        sum /= 4.0f * ((quads - begin + stride - 1) / stride);
#endif
        sum = sum_of_group(sum, partial);
        if (get_local_id(0) == 0)
            STORE(sum, (first + slot) * LIGHT_GROUPS + group);
    }
}

// The same where the static light already contains what patches have gathered.
__kernel void store_gathered(LIGHT_ARGUMENTS)
{
    const int patch = get_global_id(0);
    if (patch < count)
        STORE((float4)(0.0f), patch);
}
