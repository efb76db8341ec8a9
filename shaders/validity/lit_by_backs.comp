#version 430
// Detects patches whose probe rays hit an emissive back face (flags of validity.glsl) before more than
// MAX_OTHERS_BACKLIT others. x of a result: 1 for such a patch. The same algorithm as kernels/validity/lit_by_backs.cl.
#define RECEIVER_ACCESS readonly
#include "bvh_traversal.glsl"
#include "receiver.glsl"
#include "validity.glsl"

layout(local_size_x = 64) in;
layout(std430, binding = 7) writeonly buffer Results { vec4 results[]; };
uniform int start, end, first_planes, plane_count;

// Returns true if a point is behind one of the planes (normal, distance from the origin), or if there are no planes.
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
    vec3 origin = r.at + r.height * r.geometric;
    int count = is_behind_any(origin) ? LOOKS : 0;
    bool lit = probe(origin, r.geometric, INFINITY, count, Probes(LOOKS, MAX_OTHERS_BACKLIT, 0)).lit > 0;
    results[patch_] = vec4(lit ? 1.0 : 0.0, 0.0, 0.0, 0.0);
}
