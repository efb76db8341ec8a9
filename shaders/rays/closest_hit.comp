#version 430
// Traces rays and stores the nearest opaque hit, or the nearest back-face hit: triangle index (-1 for none), 1 for a
// front face, and the distance. kind: SHADOW or BOUNCE. The same algorithm as kernels/rays/closest_hit.cl.
#include "bvh_traversal.glsl"

layout(local_size_x = 64) in;
layout(std430, binding = 3) readonly buffer RayRecords { vec4 ray_records[]; };  // origin, direction
layout(std430, binding = 7) writeonly buffer Results { vec4 results[]; };
uniform int start, end, backs, kind;

void main()
{
    int i = start + int(gl_GlobalInvocationID.x);
    if (i >= end)
        return;
    Search search = search_for(backs != 0 ? NEAREST_BACK : NEAREST_SURFACE, kind, ray_records[2 * i].xyz,
                               ray_records[2 * i + 1].xyz, FARTHEST);
    descend(search);
    results[i] = vec4(intBitsToFloat(search.nearest.triangle), search.nearest.front ? 1.0 : 0.0,
                      search.nearest.distance, 0.0);
}
