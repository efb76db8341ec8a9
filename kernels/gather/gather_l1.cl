#include "receiver.cl"
#include "hemicube_directions.cl"
#include "irradiance_l1.cl"
#include "visibility_sample.cl"
#include "view_samples.cl"

// L1 of the light that patches gather from what they see, known as rows of patch numbers, with that of the
// static light. The sum is along right, up and normal of each view, as its samples are, and turned in the end.

// `l1_of_direction` a sample's direction in the frame of its view, times its weight.
#ifdef COSINE
// Of each sample cosine and sine of its angle and the squared radius on the disk, before a patch shifts both:
// its angle is the same for all samples of a patch, so their sum is turned instead.
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

// One patch a group, of the rows of patches from `cached_from` on.
__kernel void gather_l1(__global const Front *cache, const int cached_from,
                        __global const ReceiverRecord *receivers, PATTERN, const int samples, const int n,
                        const uint salt, const int rotate, __global const float4 *tints, const int start,
                        __global const float4 *radiance,
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
