#version 430
// Detects patches covered by a touching face. A short ray along the negative normal, from `above` to `below` the
// surface (in ray-origin heights), tests for a back face there. x of a result: 0 for none, 1 for covered, 2 for two
// coincident faces whose other sides are both open. The same algorithm as kernels/direct/contacts.cl.
#define RECEIVER_ACCESS readonly
#include "bvh_traversal.glsl"
#include "receiver.glsl"
#include "validity.glsl"

layout(local_size_x = 64) in;
layout(std430, binding = 7) writeonly buffer Results { vec4 results[]; };
uniform int start, end;
uniform float above, below;

// Maximum distance between coincident faces, as a fraction of the ray origin's height.
#define ON 0.25

void main()
{
    int patch_ = start + int(gl_GlobalInvocationID.x);
    if (patch_ >= end)
        return;
    Receiver r = load_receiver(patch_);
    vec3 up = r.height * r.geometric;
    Hit hit = nearest_hit(r.at + above * up, -(above + below) * up, true);
    float found = hit.triangle < 0 || hit.distance > 1.0 ? 0.0 : 1.0;
    bool open = found > 0.0 && abs(above - (above + below) * hit.distance) <= ON;
    for (int side = 0; side < 2 && open; ++side) {
        float turn = side == 0 ? 1.0 : -1.0;
        open = hits_few_backfaces(r.at + turn * up, turn * r.geometric, 0.0, MAX_BACKS_OPEN);
    }
    results[patch_] = vec4(open ? 2.0 : found, 0.0, 0.0, 0.0);
}
