#include "hemicube_directions.cl"
#include "visibility_sample.cl"
#include "probe_sh.cl"

// Projection of the radiance in a probe's directions to spherical harmonics.

// Returns true if the luminance of a back face is below a limit: dark ones show that a probe is inside geometry
// (engine/validity/thresholds.py).
bool is_dark(const float3 light, const float limit) { return dot(light, (float3)(0.2126f, 0.7152f, 0.0722f)) < limit; }

// Sums one probe per work group. rows: samples of trace_probes. radiance: of front faces, at entry patch + 1; patches
// from `backs` on are back faces. back_radiance: of other back faces. coefficients: BASIS
// float4 per probe; w of the first is the fraction of directions without dark back faces.
__kernel void project_probes(__global const uint *rows, __global const uchar *tint_rows, __global const float4 *tints,
                             __global const float4 *rotations, __global const float4 *directions, const int samples,
                             __global const float4 *radiance, __global const float4 *back_radiance, const uint backs,
                             const float dark, __global const float4 *sky, const int sky_width, const int sky_height,
                             const int start, __global float4 *coefficients, __local float4 *partial)
{
    const int probe = start + get_group_id(0);
    const float4 rotation = rotations[probe];
    ProbeLight sum = {{(float3)(0.0f)}};
    float out = 0.0f;
    for (int i = get_local_id(0); i < samples; i += get_local_size(0)) {
        const float3 direction = rotated(rotation, directions[i].xyz);
        const size_t place = (size_t)probe * samples + i;
        const uint sample = rows[place], entry = sample & ~(BACK | NEAR_BACK);
        float3 light;
        bool is_back = false;
        if (sample == SKY) {
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
        out += is_back ? 0.0f : 1.0f;
        add_direction(&sum, direction, light);
    }
    const float weight = 1.0f / samples, angle = 4.0f * M_PI_F * weight;
    for (int k = 0; k < BASIS; ++k) {
        const float4 all = sum_of_group((float4)(angle * sum.of[k], weight * out), partial);
        if (get_local_id(0) == 0)
            coefficients[BASIS * (size_t)probe + k] = k == 0 ? all : (float4)(all.xyz, 0.0f);
    }
}
