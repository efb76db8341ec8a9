#version 430
// Computes background light, constant over all iterations, of cached visibility samples: sky radiance, plus emission of
// back faces. One work item per patch. The same algorithm as kernels/gather/background_light.cl.
#define RECEIVER_ACCESS readonly
#include "bvh_traversal.glsl"
#include "receiver.glsl"
#include "view_samples.glsl"
#include "visibility_sample.glsl"
#include "background.glsl"
#include "irradiance_l1.glsl"

layout(local_size_x = 64) in;
layout(std430, binding = 5) readonly buffer Rows { uint rows[]; };
layout(std430, binding = 6) readonly buffer BackEmission { vec4 back_emission[]; };
// Background light, and fraction of the hemisphere without back faces, of each patch; then the L1 of each patch.
layout(std430, binding = 7) writeonly buffer Results { vec4 results[]; };
uniform int start, end, first_patch, first_l1;

void main()
{
    int item = start + int(gl_GlobalInvocationID.x);
    if (item >= end)
        return;
    View view = view_of(load_receiver(first_patch + item));
    float weight = 1.0 / float(samples), front = 0.0, open = 0.0;
    vec3 sky = vec3(0.0), backs = vec3(0.0);
    L1 sky_l1 = L1(vec3(0.0), vec3(0.0), vec3(0.0)), back_l1 = sky_l1;
    for (int i = 0; i < samples; ++i) {
        uint kept = rows[item * samples + i];
        int entry = ENTRY(kept);
        if (kept == BELOW_HORIZON)
            continue;
        front += entry > outside + 1 ? 0.0 : weight;
        if (entry < outside)
            continue;
        vec3 direction = sample_direction(view, i), tilt = l1_of_direction(direction, view.normal);
        if (entry == outside) {
            vec3 light = weight * TINTED_BY(background_radiance(direction), kept);
            sky += light;
            open += weight;
            add_l1(sky_l1, light, tilt);
        } else {
            vec3 light = weight * TINTED_BY(back_emission[entry - outside - 1].xyz, kept);
            backs += light;
            add_l1(back_l1, light, tilt);
        }
    }
    vec3 factor = factor_of_sky(view, open);
    results[item] = vec4(backs + factor * sky, front);
#ifdef DIRECTIONAL
    results[first_l1 + 3 * item] = vec4(back_l1.x + factor * sky_l1.x, 0.0);
    results[first_l1 + 3 * item + 1] = vec4(back_l1.y + factor * sky_l1.y, 0.0);
    results[first_l1 + 3 * item + 2] = vec4(back_l1.z + factor * sky_l1.z, 0.0);
#endif
}
