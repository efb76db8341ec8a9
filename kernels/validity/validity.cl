#pragma once
#include "bvh_traversal.cl"
#include "receiver.cl"
#include "probe_rays.cl"

// Whether points are inside of something, by what a few rays from them meet. The thresholds are options of the program
// (engine/validity/thresholds.py).

// True if a ray of unit direction meets a back face that is dark, or nearer than `near`: light leaks below the rim of
// a shell through texels that it crosses, and lights its back there. lit: 1 for each triangle whose back face sends
// out light, null if none does.
bool meets_dark_back(const Hit *hit, __global const uchar *lit, const float near)
{
    return hit->triangle >= 0 && !hit->front && !(lit && lit[hit->triangle] && hit->distance > near);
}

// True if at most `most` of the looks from a point meet dark back faces. No more are cast than it takes to decide.
bool hits_few_backfaces(const Rays *rays, const float3 start, const float3 normal, __global const uchar *lit,
                        const float near, const int most)
{
    float3 x, y;
    basis(normal, &x, &y);
    int backs = 0;
    for (int i = 0; backs <= most && i - backs < LOOKS - most; ++i) {
        const Hit hit = nearest_hit(rays, start, probe_direction(i, x, y, normal), false);
        backs += meets_dark_back(&hit, lit, near);
    }
    return backs <= most;
}

// True if no more than half of the looks from a point meet back faces.
bool is_outside(const Rays *rays, const float3 start, const float3 normal)
{
    return hits_few_backfaces(rays, start, normal, 0, 0.0f, MAX_BACKS_OPEN);
}
