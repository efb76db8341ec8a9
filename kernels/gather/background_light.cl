#include "receiver.cl"
#include "irradiance_l1.cl"
#include "visibility_sample.cl"
#include "view_samples.cl"
#include "unoccluded_sky.cl"

// Computes background light, constant over all iterations: sky radiance at samples that hit the background, plus
// emission of back faces. One work group per patch, for cached rows from patch `cached_from` on.

__kernel void add_background(__global const Front *cache, const int cached_from,
                             __global const ReceiverRecord *receivers, SAMPLES, const int samples, const int n,
                             const uint salt, const int rotate, __global const float4 *tints, const int start,
                             const uint outside, SKY_ARGUMENTS, __global const float4 *back_light,
                             __global const float4 *back_l1, __global float4 *static_light, __global float4 *static_l1,
                             __local float4 *partial)
{
    const int patch = start + get_group_id(0);
    __global const Front *row = cache + (size_t)(patch - cached_from) * samples;
    const Receiver receiver = load_receiver(receivers + patch);
    const View view = view_of(&receiver, patch, samples, salt, rotate);
    ViewSum seen = {(float4)(0.0f)}, sum = {(float4)(0.0f)};
#ifdef DIRECTIONAL
    const bool directed = true;
#else
    const bool directed = sky_width * sky_height > 1;
#endif
    for (int i = get_local_id(0); i < samples; i += get_local_size(0)) {
        if (ENTRY(row[i]) != outside)
            continue;

        // A uniform sky needs no directions.
        const float3 direction = directed ? sample_direction(&view, i, pattern, n) : view.normal;
        const float3 sky_light = background_radiance(direction, sky, (int2)(sky_width, sky_height)).xyz;
        const float3 light = TINTED_BY(sky_light, row[i], tints);
        add_light(&seen, WEIGHT(i) * (float4)(light, 1.0f), l1_of_direction(direction, view.normal));
    }
    scale_to_sky(&seen, &view, pattern, samples, n, sky, sky_width, sky_height, open_sky, partial);
    add_sky(&sum, &seen);
    if (get_local_id(0) == 0) {
        sum.light += back_light[patch];
#ifdef DIRECTIONAL
        sum.l1.x += back_l1[3 * (size_t)patch];
        sum.l1.y += back_l1[3 * (size_t)patch + 1];
        sum.l1.z += back_l1[3 * (size_t)patch + 2];
#endif
    }
    store_light(&sum, patch, static_light, static_l1, partial);
}
