#version 430
// Patches that see little but back faces, and among these one of a triangle that shines (the flags of validity.glsl).
// As kernels/validity/lit_by_backs.cl. x of a result: 1 for such a patch.
#define RECEIVER_ACCESS readonly
#include "bvh_traversal.glsl"
#include "receiver.glsl"
#include "validity.glsl"

layout(local_size_x = 64) in;
layout(std430, binding = 7) writeonly buffer Results { vec4 results[]; };
uniform int start, end, first_planes, plane_count;

// Whether a point is behind one of the planes, normal and distance from the origin. Without planes it may be.
bool is_behind_any(const vec3 point)
{
    bool behind = plane_count == 0;
    for (int i = 0; i < plane_count && !behind; ++i) {
        int k = first_planes + 4 * i;
        vec4 plane = uintBitsToFloat(uvec4(validity_tables[k], validity_tables[k + 1], validity_tables[k + 2],
                                           validity_tables[k + 3]));
        behind = dot(plane.xyz, point) < plane.w;
    }
    return behind;
}

void main()
{
    int patch_ = start + int(gl_GlobalInvocationID.x);
    if (patch_ >= end)
        return;
    Receiver r = load_receiver(patch_);
    vec3 origin = r.at + r.height * r.geometric, x, y;
    basis(r.geometric, x, y);
    int probes = is_behind_any(origin) ? LOOKS : 0, others = 0;
    bool lit = false;
    for (int i = 0; i < probes && !lit && others <= MAX_OTHERS_BACKLIT; ++i) {
        Hit hit = nearest_hit(origin, probe_direction(i, x, y, r.geometric), false);
        bool back = is_back(hit);
        lit = back && is_flagged(hit.triangle);
        others += int(!back);
    }
    results[patch_] = vec4(lit ? 1.0 : 0.0, 0.0, 0.0, 0.0);
}
