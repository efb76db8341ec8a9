#include "bvh_traversal.cl"

// Traces rays and stores the closest hit: (triangle index or -1, 1 for a front face) in `hits`, and the distance.
// backs: only back faces count. kind: SHADOW or BOUNCE.
__kernel void closest_hit(RAYS_ARGUMENTS, __global const float4 *origins, __global const float4 *directions,
                          const int backs, const int kind, __global int2 *hits, __global float *distances,
                          const int count)
{
    const int i = get_global_id(0);
    if (i >= count)
        return;
    const Rays rays = RAYS;
    Search search = search_for(backs ? NEAREST_BACK : NEAREST, kind, origins[i].xyz, directions[i].xyz, FARTHEST);
    descend(&rays, &search);
    hits[i] = (int2)(search.nearest.triangle, search.nearest.front);
    distances[i] = search.nearest.distance;
}
