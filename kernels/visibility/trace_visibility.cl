#include "bvh_traversal.cl"
#include "receiver.cl"
#include "irradiance_l1.cl"
#include "visibility_sample.cl"
#include "view_samples.cl"
#include "trace_sample.cl"
#include "gather_rays.cl"

// Visibility by ray tracing: finds which patch each hemisphere sample of a patch hits.

// Fills one row of the visibility cache per patch with entry IDs, one work group per patch. Also sums emission of back
// faces, and the fractions of the hemisphere for the flux balance.
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
        uint kept = 0;
        if (dot(direction, view.horizon) > 0.0f) {
            advance_origin(&eye, &view, &rays, &receiver, i, samples);
            uint tint;
            const uint seen = trace_sample(&rays, &lightmaps, eye.at, direction, &tint);
            kept = encode_sample(seen, tint, WEIGHT(i), direction, view.normal, emission, backs_seen, outside,
                                 RAY_TINTS(rays), &sum);
        }
        cache[(size_t)(patch - cached_from) * samples + i] = kept;
    }
    store_view(&sum, patch, back_light, patches_seen, back_l1, partial);
}
