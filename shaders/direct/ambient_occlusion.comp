#version 430
// Computes ambient occlusion: the cosine-weighted fraction of each patch's hemisphere without geometry nearer than
// `reach` (metres). The same algorithm as kernels/direct/ambient_occlusion.cl.
#define RECEIVER_ACCESS readonly
#define STATE_WORDS 4
#include "bvh_traversal.glsl"
#include "resumed.glsl"
#include "receiver.glsl"
#include "texel_ray_origins.glsl"
#include "sample_points.glsl"

layout(local_size_x = 64) in;
layout(std430, binding = 7) writeonly buffer Results { vec4 results[]; };
uniform int start, end, budget;
uniform float reach;
uniform uint seed;

void main()
{
    int patch_ = start + int(gl_GlobalInvocationID.x);
    if (patch_ >= end)
        return;
    Receiver r = load_receiver(patch_);
    vec3 x, y;
    basis(r.normal, x, y);
    uint key = hash(r.rank ^ hash(seed));
    float open = 0.0, all = 0.0;
    int i = 0, slot = patch_ - start;
    uint state = begin_state(slot, false);
    if (state == 2u)
        return;
    if (state == 1u) {
        exchange(i);
        exchange(open);
        exchange(all);
    }
    for (; i < budget && steps < MAX_STEPS; ++i) {
        ++steps;
        vec4 u = sample_point(uint(i), key);
        vec3 direction = cosine_direction(u.xy, x, y, r.normal);
        if (dot(direction, r.geometric) <= 0.0)
            continue;
        vec3 p = jittered_origin(r, u.zw);
        open += grey_of(transmittance(BOUNCE, p + ray_origin(r, p, direction), direction, reach));
        all += 1.0;
    }
    begin_state(slot, true);
    exchange(i);
    exchange(open);
    exchange(all);
    end_state(slot, i == budget);
    results[patch_] = vec4(vec3(all > 0.0 ? open / all : 0.0), 0.0);
}
