#version 430
// Gathers irradiance of patches, or its L1, from the front faces in cached visibility samples. One work item per patch.
// The same algorithms as kernels/gather/gather.cl and kernels/gather/gather_l1.cl.
#define RECEIVER_ACCESS readonly
#include "bvh_traversal.glsl"
#include "receiver.glsl"
#include "view_samples.glsl"
#include "visibility_sample.glsl"
#include "irradiance_l1.glsl"

layout(local_size_x = 64) in;
layout(std430, binding = 5) readonly buffer Rows { uint rows[]; };
layout(std430, binding = 6) readonly buffer Radiance { vec4 radiance[]; };
// With DIRECTIONAL three vectors per patch, else one.
layout(std430, binding = 7) writeonly buffer Results { vec4 results[]; };
uniform int start, end, first_patch;

void main()
{
    int item = start + int(gl_GlobalInvocationID.x);
    if (item >= end)
        return;
#ifdef DIRECTIONAL
    View view = view_of(load_receiver(first_patch + item));
    L1 l1 = L1(vec3(0.0), vec3(0.0), vec3(0.0));
#endif
    vec3 sum = vec3(0.0);
    for (int i = 0; i < samples; ++i) {
        uint kept = rows[item * samples + i];
        int entry = ENTRY(kept);
        if (entry == 0 || entry >= outside)
            continue;
        vec3 light = TINTED_BY(radiance[entry].xyz, kept) / float(samples);
#ifdef DIRECTIONAL
        add_l1(l1, light, l1_of_direction(sample_direction(view, i), view.normal));
#else
        sum += light;
#endif
    }
#ifdef DIRECTIONAL
    results[3 * item] = vec4(l1.x, 0.0);
    results[3 * item + 1] = vec4(l1.y, 0.0);
    results[3 * item + 2] = vec4(l1.z, 0.0);
#else
    results[item] = vec4(sum, 0.0);
#endif
}
