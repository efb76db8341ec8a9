#include "visibility_sample.cl"

// One gather iteration over the visibility cache: sums the radiance of the entries that each patch's samples hit.
// LIGHT_GROUPS light groups are gathered at once (1 without groups); their radiance is interleaved per patch, so that
// each entry is read once.

#define LIGHT_ARGUMENTS \
    __global const float4 *static_light, __global const float4 *direct, __global const float4 *irradiance, \
        __global float4 *gathered, __global float4 *defects, const int column, const int count

// Stores a patch's irradiance, the sum of gathered, background and direct light, and its defect, the change since the
// last iteration.
#define STORE(light, patch) \
    do { \
        const float4 all = light + static_light[patch] + direct[patch]; \
        gathered[(size_t)column * count + patch] = all; \
        defects[(size_t)column * count + patch] = all - irradiance[patch]; \
    } while (0)

// Returns the weighted radiance of four samples. EVEN: samples have equal weights, and the caller divides by their
// number.
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

// Gathers one patch per work group, from patch `first` on. Reads one quad of samples in `stride`; neighbouring patches
// start at different quads. `stride` is 1 without EVEN.
__kernel void gather(__global const Front4 *cache, __global const float4 *multiplier, __global const float4 *radiance,
                     LIGHT_ARGUMENTS, const int quads, const int stride, const int first, __global const float4 *tints,
                     __local float4 *partial)
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

// Variant of the kernel for background light that already includes the gathered light: only stores irradiance and
// defect.
__kernel void store_gathered(LIGHT_ARGUMENTS)
{
    const int patch = get_global_id(0);
    if (patch < count)
        STORE((float4)(0.0f), patch);
}
