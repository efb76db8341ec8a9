#include "receiver.cl"
#include "hemicube_directions.cl"
#include "irradiance_l1.cl"
#include "visibility_sample.cl"
#include "view_samples.cl"

// Gathers L1 of indirect light from the visibility cache and adds L1 of the background light. Sums are in the local
// frame of each view (right, up, normal) and rotated to world space at the end.

// Returns the L1 of sample i per unit of light, in the local frame of the view, times the sample's weight.
#ifdef COSINE
// pattern: cosine and sine of each sample's azimuth, and squared radius on the disk, before the shift of the patch. The
//     azimuth shift is common to all samples of a patch, so the sum is rotated instead.
#define PATTERN __global const float4 *pattern
float3 tilt_of_sample(PATTERN, const int i, const int samples, const int n, const float shift)
{
    const float4 sample = pattern[i];
    const float u = sample.z + shift - floor(sample.z + shift);
    const float2 tilt = l1_factors(sqrt(1.0f - u));
    return (float3)(sample.xy * (tilt.x * sqrt(u)), tilt.y) / samples;
}
#else
#define PATTERN __global const float *pattern
float3 tilt_of_sample(PATTERN, const int i, const int samples, const int n, const float shift)
{
    return pattern[i] * l1_of_direction(texel_direction(i % n, i / n, n), (float3)(0.0f, 0.0f, 1.0f));
}
#endif

// Processes one patch per work group. static_l1: L1 of the background light, three float4 per patch.
__kernel void gather_l1(__global const Front *cache, const int cached_from, __global const ReceiverRecord *receivers,
                        PATTERN, const int samples, const int n, const uint salt, const int rotate,
                        __global const float4 *tints, const int start, __global const float4 *radiance,
                        __global const float4 *static_l1, __global float4 *l1, __local float4 *partial)
{
    const int patch = start + get_group_id(0);
    __global const Front *row = cache + (size_t)(patch - cached_from) * samples;
    const Receiver receiver = load_receiver(receivers + patch);
    const View view = view_of(&receiver, patch, samples, salt, rotate);
    const float2 shift = convert_float2(view.shift >> 8) * (1.0f / 16777216.0f);
    float4 along_right = (float4)(0.0f), along_up = (float4)(0.0f), along_normal = (float4)(0.0f);
    for (int i = get_local_id(0); i < samples; i += get_local_size(0)) {
#ifdef TINTED
        const float4 light = radiance[ENTRY(row[i])] * tints[TINT_INDEX(row[i])];
#else
        const float4 light = radiance[row[i]];
#endif
        const float3 tilt = tilt_of_sample(pattern, i, samples, n, shift.x);
        along_right += tilt.x * light;
        along_up += tilt.y * light;
        along_normal += tilt.z * light;
    }
#ifdef COSINE
    const float c = cospi(2.0f * shift.y), s = sinpi(2.0f * shift.y);
    const float3 right = c * view.right + s * view.up, up = c * view.up - s * view.right;
#else
    const float3 right = view.right, up = view.up;
#endif
    L1 sum = {right.x * along_right + up.x * along_up + view.normal.x * along_normal,
              right.y * along_right + up.y * along_up + view.normal.y * along_normal,
              right.z * along_right + up.z * along_up + view.normal.z * along_normal};
    if (get_local_id(0) == 0) {
        sum.x += static_l1[3 * (size_t)patch];
        sum.y += static_l1[3 * (size_t)patch + 1];
        sum.z += static_l1[3 * (size_t)patch + 2];
    }
    store_l1(&sum, patch, l1, partial);
}
