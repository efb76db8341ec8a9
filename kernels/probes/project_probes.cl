#include "hemicube_directions.cl"
#include "visibility_sample.cl"
#include "probe_sh.cl"

// Projection of the radiance in a probe's directions to spherical harmonics. The directions of a probe are a rotated
// copy of those that all probes share: sums are made in the axes of the shared ones, whose harmonics are a table, and
// the coefficients are rotated once per probe.

// Returns true if the luminance of a back face is below a limit: dark ones show that a probe is inside geometry
// (engine/validity/thresholds.py).
bool is_dark(const float3 light, const float limit) { return dot(light, (float3)(0.2126f, 0.7152f, 0.0722f)) < limit; }

// Sums one probe per work group. rows: samples of trace_probes. harmonics: bands 1 and 2 of each direction. radiance:
// of front faces, at entry patch + 1; patches from `backs` on are back faces. back_radiance: of other back faces.
// coefficients: 3 BASIS per probe, then the fraction of directions without dark back faces.
__kernel void project_probes(__global const uint *rows, __global const uchar *tint_rows, __global const float4 *tints,
                             __global const float4 *rotations, __global const float4 *directions,
                             __global const float8 *harmonics, const int samples, __global const float4 *radiance,
                             __global const float4 *back_radiance, const uint backs, const float dark,
                             __global const float4 *sky, const int sky_width, const int sky_height, const int start,
                             __global float *coefficients, __local float4 *partial)
{
    const int probe = start + get_group_id(0);
    const float4 rotation = rotations[probe];
    float4 mean = (float4)(0.0f);
    float8 red = (float8)(0.0f), green = (float8)(0.0f), blue = (float8)(0.0f);
    for (int i = get_local_id(0); i < samples; i += get_local_size(0)) {
        const size_t place = (size_t)probe * samples + i;
        const uint sample = rows[place], entry = sample & ~(BACK | NEAR_BACK);
        float3 light;
        bool is_back = false;
        if (sample == SKY) {
            const float3 direction = rotated(rotation, directions[i].xyz);
            light = background_radiance(direction, sky, (int2)(sky_width, sky_height)).xyz;
        } else if (sample & BACK) {
            light = back_radiance[entry].xyz;
            is_back = true;
        } else {
            light = radiance[entry].xyz;
            is_back = (sample & NEAR_BACK) || (entry >= backs && is_dark(light, dark));
        }
#ifdef TINTED
        light *= tints[tint_rows[place]].xyz;
#endif
        mean += (float4)(light, is_back ? 0.0f : 1.0f);
        const float8 functions = harmonics[i];
        red += light.x * functions;
        green += light.y * functions;
        blue += light.z * functions;
    }
    const float weight = 1.0f / samples, angle = 4.0f * M_PI_F * weight;
    const float4 all = weight * sum_of_group(mean, partial);
    ProbeLight sum = {{4.0f * M_PI_F * BAND_0 * all.xyz}};
#define COLOURS(k) angle *sum_of_group((float4)(red.s##k, green.s##k, blue.s##k, 0.0f), partial).xyz
    sum.of[1] = COLOURS(0);
    sum.of[2] = COLOURS(1);
    sum.of[3] = COLOURS(2);
    sum.of[4] = COLOURS(3);
    sum.of[5] = COLOURS(4);
    sum.of[6] = COLOURS(5);
    sum.of[7] = COLOURS(6);
    sum.of[8] = COLOURS(7);
    if (get_local_id(0) > 0)
        return;
    rotate_light(&sum, rotation);
    __global float *own = coefficients + (3 * BASIS + 1) * (size_t)probe;
    for (int k = 0; k < BASIS; ++k)
        vstore3(sum.of[k], k, own);
    own[3 * BASIS] = all.w;
}
