#include "bvh_traversal.cl"

// Stores the transmittance, rgb, along each ray from its origin up to the distance in w of its direction. kind: SHADOW
// or BOUNCE.
__kernel void through_surface(RAYS_ARGUMENTS, __global const float4 *origins, __global const float4 *directions,
                              const int kind, __global float *through, const int count)
{
    const int i = get_global_id(0);
    if (i >= count)
        return;
    const Rays rays = RAYS;
    vstore3((float3)(transmittance(&rays, kind, origins[i].xyz, directions[i].xyz, directions[i].w)), i, through);
}
