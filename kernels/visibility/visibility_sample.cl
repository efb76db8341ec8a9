#pragma once
#include "irradiance_l1.cl"

// Encoding of visibility samples. An item-buffer entry is patch + 1 (0: surface without a patch), with the BACK bit for
// back faces, or SKY.

// The visibility cache stores patch + 1 for front faces, `outside` for the background, and 0 otherwise. These values
// index the radiance array, whose entry `outside`, the last, is black. NARROW: entries fit 16 bits.
#ifdef NARROW
typedef ushort Front;
typedef ushort4 Front4;
#else
typedef uint Front;
typedef uint4 Front4;
#endif

// TINTED: the bits above ENTRY_BITS hold the tint of the sample's light, an index into the palette `tints`, 0 for white
//     (engine/scene/tints.py). Samples then have 32 bits.
#ifdef TINTED
#define ENTRY_BITS 26
#define ENTRY(kept) ((kept) & ((1u << ENTRY_BITS) - 1u))
#define TINT_INDEX(kept) ((kept) >> ENTRY_BITS)
#define KEPT(entry, tint) ((entry) ? (entry) | (tint) << ENTRY_BITS : 0u)
#define TINTED_BY(light, kept, tints) ((light) * (tints)[TINT_INDEX(kept)].xyz)
#else
#define ENTRY(kept) (kept)
#define TINT_INDEX(kept) 0u
#define KEPT(entry, tint) (entry)
#define TINTED_BY(light, kept, tints) (light)
#endif

#define BACK 0x80000000u
#define SKY 0x7FFFFFFFu

float4 sum_of_group(const float4 value, __local float4 *partial)
{
    const int item = get_local_id(0);
    barrier(CLK_LOCAL_MEM_FENCE);
    partial[item] = value;
    for (int step = get_local_size(0) / 2; step > 0; step /= 2) {
        barrier(CLK_LOCAL_MEM_FENCE);
        if (item < step)
            partial[item] += partial[item + step];
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    return partial[0];
}

// Sums over the samples of a view. light.xyz: emission of visible back faces, weighted. light.w: weight of all samples
// that hit no back face. patches: weight of samples that hit patches. l1: L1 of the light (irradiance_l1.cl).
typedef struct {
    float4 light;
    float patches;
    L1 l1;
} ViewSum;

// Adds light from a direction with the given `l1_of_direction`; w adds to the fraction without back faces.
void add_light(ViewSum *sum, const float4 light, const float3 tilt)
{
    sum->light += light;
    add_l1(&sum->l1, light.xyz, tilt);
}

// Adds a sample's hit to the sums of a view and returns its cache entry. world: direction, world space. backs_seen: 1
// per entry whose back face is hit by any sample.
uint encode_sample(const uint seen, const uint tint, const float weight, const float3 world, const float3 normal,
                   __global const float4 *emission, __global uchar *backs_seen, const uint outside,
                   __global const float4 *tints, ViewSum *sum)
{
    if (seen == SKY) {
        sum->light.w += weight;
        return KEPT(outside, tint);
    }
    if (seen & BACK) {
        const uint entry = seen & ~BACK;
        backs_seen[entry] = 1;
        const float3 light = TINTED_BY(emission[entry].xyz, KEPT(1u, tint), tints);
        add_light(sum, weight * (float4)(light, entry ? 0.0f : 1.0f), l1_of_direction(world, normal));
        return 0;
    }
    sum->light.w += weight;
#ifdef TINTED
    sum->patches += seen ? weight * dot(tints[tint].xyz, (float3)(0.2126f, 0.7152f, 0.0722f)) : 0.0f;
#else
    sum->patches += seen ? weight : 0.0f;
#endif
    return KEPT(seen, tint);
}

// Sums L1 over the work group and stores it as three float4 per patch: x, y and z axes.
void store_l1(const L1 *l1, const int patch, __global float4 *stored, __local float4 *partial)
{
    const float4 x = sum_of_group(l1->x, partial);
    const float4 y = sum_of_group(l1->y, partial);
    const float4 z = sum_of_group(l1->z, partial);
    if (get_local_id(0) == 0) {
        stored[3 * (size_t)patch] = x;
        stored[3 * (size_t)patch + 1] = y;
        stored[3 * (size_t)patch + 2] = z;
    }
}

// Stores the sums of a view: light and, if DIRECTIONAL, its L1.
void store_light(const ViewSum *sum, const int patch, __global float4 *stored_light, __global float4 *stored_l1,
                 __local float4 *partial)
{
    const float4 light = sum_of_group(sum->light, partial);
    if (get_local_id(0) == 0)
        stored_light[patch] = light;
#ifdef DIRECTIONAL
    store_l1(&sum->l1, patch, stored_l1, partial);
#endif
}

void store_view(const ViewSum *sum, const int patch, __global float4 *stored_light, __global float *patches_seen,
                __global float4 *stored_l1, __local float4 *partial)
{
    store_light(sum, patch, stored_light, stored_l1, partial);
    const float4 patches = sum_of_group((float4)(sum->patches), partial);
    if (get_local_id(0) == 0)
        patches_seen[patch] = patches.x;
}
