#pragma once
#include "bvh_traversal.cl"
#include "receiver.cl"
#include "probe_rays.cl"

// Validity tests: decide from a few probe rays if a point is inside geometry. Thresholds are build options
// (engine/validity/thresholds.py).

// Returns true if a hit is a back face that is dark or nearer than `near`. Light leaks under the rim of a shell through
// texels that it crosses, so a lit back face counts as outside only at a distance. lit: 1 for each triangle with a lit
// back face; null if there are none.
bool meets_dark_back(const Hit *hit, __global const uchar *lit, const float near)
{
    return hit->triangle >= 0 && !hit->front && !(lit && lit[hit->triangle] && hit->distance > near);
}

// Returns true if at most `most` of the LOOKS probe rays hit dark back faces. Stops as soon as the result is certain.
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

// Returns true if at most MAX_BACKS_OPEN probe rays of a point hit back faces.
bool is_outside(const Rays *rays, const float3 start, const float3 normal)
{
    return hits_few_backfaces(rays, start, normal, 0, 0.0f, MAX_BACKS_OPEN);
}
