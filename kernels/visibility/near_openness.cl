#include "bvh_traversal.cl"
#include "receiver.cl"
#include "probe_rays.cl"
#include "texel_ray_origins.cl"
#include "shaft.cl"

// Short-range openness: the unoccluded fraction of the hemisphere within a few texels. Irradiance interpolated from
// neighbours misses such nearby geometry.

#if PACKET == 8
// Collects the triangles within reach of a texel on a flat surface, by shaft culling with a pyramid around the
// hemisphere; its sides rise at 45 degrees.
void find_near(const Rays *rays, const Receiver *r, const float reach, Blockers *near)
{
    Shaft shaft;
    float3 x, y;
    basis(r->geometric, &x, &y);
    const float3 normals[4] = {x, -x, y, -y};
    const float radius = 1.001f * (reach + 0.5f * (length(r->edge_u) + length(r->edge_v))),
                half_side = 1.4143f * radius;
    shaft.start = r->at + r->height * r->geometric;
    for (int k = 0; k < 4; ++k) {
        shaft.normals[k] = 0.70710678f * (normals[k] + r->geometric);
        shaft.most[k] = radius;
    }
    shaft.normals[4] = -r->geometric;
    shaft.most[4] = 0.5f * r->height;
    for (int k = 0; k < 3; ++k)
        shaft.corners[k] = half_side * r->geometric;
    shaft.across = half_side * x;
    shaft.along = half_side * y;
    shaft.slack = 0.0f;
    find_within(rays, &shaft, near);
}
#else
void find_near(const Rays *rays, const Receiver *r, const float reach, Blockers *near) {}
#endif

// Returns the transmittance of a ray with respect to nearby geometry.
float let_through(const Rays *rays, const Blockers *near, const float3 origin, const float3 direction,
                  const float reach)
{
#ifndef TRANSMISSION
    if (near->count != UNKNOWN_BLOCKERS)
        return shaft_is_clear(near, origin, direction, reach);
#endif
    return grey_of(transmittance(rays, BOUNCE, origin, direction, reach));
}

// Stores the cosine-weighted fraction of each patch's hemisphere without geometry within `reach` texels. All patches
// use the same rays, so that results differ only by geometry.
__kernel void near_openness(RAYS_ARGUMENTS, __global const ReceiverRecord *receivers, const float reach,
                            __global float *open, const int count)
{
    const int patch = get_global_id(0);
    if (patch >= count)
        return;
    const Rays rays = RAYS;
    const Receiver r = load_receiver(receivers + patch);
    const float distance = reach * r.size;
    Blockers near = {UNKNOWN_BLOCKERS};
    if (!(r.lifted > 0.0f))
        find_near(&rays, &r, distance, &near);
    open[patch] = 1.0f;
    if (near.count == 0)
        return;
    float3 x, y;
    basis(r.normal, &x, &y);
    float through = 0.0f, all = 0.0f;
    for (int i = 0; i < LOOKS; ++i) {
        const float3 direction = probe_direction(i, x, y, r.normal);
        if (dot(direction, r.geometric) <= 0.0f)
            continue;
        const float3 p = jittered_origin(&rays, &r, place_of_sample(i, (uint2)(0)));
        through += let_through(&rays, &near, p + ray_origin(&r, p, direction), direction, distance);
        all += 1.0f;
    }
    open[patch] = all > 0.0f ? through / all : 0.0f;
}
