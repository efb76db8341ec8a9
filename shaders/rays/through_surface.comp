#version 430
// Stores the transmittance, rgb, along each ray from its origin up to the distance in w of its direction. kind: SHADOW
// or BOUNCE. The same algorithm as kernels/rays/through_surface.cl.
#include "bvh_traversal.glsl"

layout(local_size_x = 64) in;
layout(std430, binding = 3) readonly buffer RayRecords { vec4 ray_records[]; };  // origin, direction
layout(std430, binding = 7) writeonly buffer Results { vec4 results[]; };
uniform int start, end, kind;

void main()
{
    int i = start + int(gl_GlobalInvocationID.x);
    if (i >= end)
        return;
    vec4 direction = ray_records[2 * i + 1];
    results[i] = vec4(vec3(transmittance(kind, ray_records[2 * i].xyz, direction.xyz, direction.w)), 0.0);
}
