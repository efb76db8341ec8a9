#pragma once
#include "bvh_traversal.cl"
#include "receiver.cl"
#include "irradiance_l1.cl"
#include "visibility_sample.cl"
#include "view_samples.cl"
#include "unoccluded_sky.cl"
#include "trace_sample.cl"

// Visibility by ray tracing: finds which patch each hemisphere sample of a patch hits. HITS: the samples were traced
// before, by trace_hits.cl.
#ifdef HITS
#define TRACED(hit) entry_of_hit(&lightmaps, hit)
#define HITS_ARGUMENTS , __global const uint *hits, const int hits_from
#else
#define TRACED(hit) trace_sample(&rays, &lightmaps, eye.at, direction, &tint)
#define HITS_ARGUMENTS
#endif

// Fills one row of the visibility cache per patch with entry IDs, one work group per patch. Also sums emission of back
// faces, and the fractions of the hemisphere for the flux balance. HITS: replaces the hits that the cache holds.
__kernel void trace_visibility(LOOK_ARGUMENTS, const int start, const int cached_from, __global Front *cache,
                               __global float4 *back_light, __global float *patches_seen, __global uchar *backs_seen,
                               __global float4 *back_l1, __local float4 *partial)
{
    const int patch = start + get_group_id(0);
    const Rays rays = RAYS;
    const Lightmaps lightmaps = {uvs, atlases, texel_to_patch, resolution, backs};
    const Receiver receiver = load_receiver(receivers + patch);
    const View view = view_of(&receiver, patch, samples, salt, rotate);
    Eye eye = {view.eye, -1};
    ViewSum sum = {(float4)(0.0f)};
    for (int i = get_local_id(0); i < samples; i += get_local_size(0)) {
        const float3 direction = sample_direction(&view, i, pattern, n);
        __global Front *entry = cache + (size_t)(patch - cached_from) * samples + i;
        uint kept = 0;
        if (dot(direction, view.horizon) > 0.0f) {
            advance_origin(&eye, &view, &rays, &receiver, i, samples);
            uint tint = 0;
            const uint seen = TRACED(*entry);
            kept = encode_sample(seen, tint, WEIGHT(i), direction, view.normal, emission, backs_seen, outside,
                                 RAY_TINTS(rays), &sum);
        }
        *entry = kept;
    }
    store_view(&sum, patch, back_light, patches_seen, back_l1, partial);
}

// Gathers irradiance (E/pi) of patches by tracing all samples, without a visibility cache. Background light is scaled
// by the ratio estimator (unoccluded_sky.cl).
__kernel void gather_rays(LOOK_ARGUMENTS, const int start, __global const float4 *radiance, SKY_ARGUMENTS,
                          __global float4 *gathered_light, __global float *patches_seen, __global uchar *backs_seen,
                          __global float4 *gathered_l1, __local float4 *partial HITS_ARGUMENTS)
{
    const int patch = start + get_group_id(0);
    const Rays rays = RAYS;
    const Lightmaps lightmaps = {uvs, atlases, texel_to_patch, resolution, backs};
    const Receiver receiver = load_receiver(receivers + patch);
    const View view = view_of(&receiver, patch, samples, salt, rotate);
    Eye eye = {view.eye, -1};
    ViewSum of_sky = {(float4)(0.0f)}, sum = {(float4)(0.0f)};
    for (int i = get_local_id(0); i < samples; i += get_local_size(0)) {
        const float3 direction = sample_direction(&view, i, pattern, n);
        if (dot(direction, view.horizon) <= 0.0f)
            continue;
        advance_origin(&eye, &view, &rays, &receiver, i, samples);
        uint tint = 0;
        const uint seen = TRACED(hits[(size_t)(patch - hits_from) * samples + i]);
        const uint kept = encode_sample(seen, tint, WEIGHT(i), direction, view.normal, emission, backs_seen, outside,
                                        RAY_TINTS(rays), &sum);
        const float3 tilt = l1_of_direction(direction, view.normal);
        if (ENTRY(kept) == outside) {
            const float3 light = background_radiance(direction, sky, (int2)(sky_width, sky_height)).xyz;
            add_light(&of_sky, WEIGHT(i) * (float4)(TINTED_BY(light, kept, rays.tints), 1.0f), tilt);
        } else {
            const float3 light = radiance[ENTRY(kept)].xyz;
            add_light(&sum, WEIGHT(i) * (float4)(TINTED_BY(light, kept, rays.tints), 0.0f), tilt);
        }
    }
    scale_to_sky(&of_sky, &view, pattern, samples, n, sky, sky_width, sky_height, open_sky, partial);
    add_sky(&sum, &of_sky);
    store_view(&sum, patch, gathered_light, patches_seen, gathered_l1, partial);
}
