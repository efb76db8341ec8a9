#include "rays.cl"

// The nearest triangle along each ray, or the nearest that shows its back: number (-1 for none), and 1 for
// its front; its distance.
__kernel void cast(RAYS_ARGUMENTS, __global const float4 *origins, __global const float4 *directions,
                   const int backs, __global int2 *hits, __global float *distances, const int count)
{
    const int i = get_global_id(0);
    if (i >= count)
        return;
    const Rays rays = RAYS;
    const Hit hit = nearest_hit(&rays, origins[i].xyz, directions[i].xyz, backs != 0);
    hits[i] = (int2)(hit.triangle, hit.front);
    distances[i] = hit.distance;
}
