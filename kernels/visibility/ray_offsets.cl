#include "bvh_traversal.cl"
#include "receiver.cl"
#include "texel_ray_origins.cl"

// Test points of a texel for the offset, in texels from its centre.
__constant float2 TRIED[5] = {{0.0f, 0.0f}, {-0.4f, -0.4f}, {0.4f, -0.4f}, {-0.4f, 0.4f}, {0.4f, 0.4f}};

// Limits the offset of ray origins to the smooth surface (smooth_offset): 0 where the surface is flat, concave or
// inverted; else at most half of the distance to the geometry above, so that origins stay on this side of it. Also
// stores in the lowest bit of `rank` whether a face crosses the texel.
__kernel void find_ray_offsets(RAYS_ARGUMENTS, __global ReceiverRecord *receivers, const int count)
{
    const int patch = get_global_id(0);
    if (patch >= count)
        return;
    const Rays rays = RAYS;
    const Receiver r = load_receiver(receivers + patch);
    float lifted = any(smooth_offset(&r, r.at) != 0.0f) ? 1.0f : 0.0f;
    for (int i = 0; i < 5 && lifted > 0.0f; ++i) {
        const float3 p = point_of_texel(&r, TRIED[i] + 0.5f), lift = smooth_offset(&r, p);
        if (any(lift != 0.0f))
            lifted = fmin(lifted, 0.5f * nearest_hit(&rays, p + r.height * r.geometric, lift, false).distance);
    }
    receivers[patch].lifted = lifted;
    receivers[patch].rank |= is_crossed(&rays, &r);
}
