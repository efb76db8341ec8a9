#pragma once
#include "bvh_traversal.cl"
#include "receiver.cl"
#include "probe_rays.cl"

// Validity tests: decide from a few probe rays if a point is inside geometry. Thresholds are build options
// (engine/validity/thresholds.py).

// Counts of the hits of a point's probe rays.
typedef struct {
    int backs;   // dark back faces, see meets_dark_back
    int others;  // misses, front faces, and lit back faces at a distance
    int lit;     // all back faces flagged in `lit`
} Probes;

// Returns true if a hit is a back face that is dark or nearer than `near`. Light leaks under the rim of a shell through
// texels that it crosses, so a lit back face counts as outside only at a distance. lit: 1 for each triangle with a lit
// back face; null if there are none.
bool meets_dark_back(const Hit *hit, __global const uchar *lit, const float near)
{
    return hit->triangle >= 0 && !hit->front && !(lit && lit[hit->triangle] && hit->distance > near);
}

// Traces the first `count` probe rays of a point. Stops as soon as one number exceeds that in `most`.
Probes probe(const Rays *rays, const float3 start, const float3 normal, __global const uchar *lit, const float near,
             const int count, const Probes most)
{
    float3 x, y;
    basis(normal, &x, &y);
    Probes probes = {0, 0, 0};
    for (int i = 0; i < count && probes.backs <= most.backs && probes.others <= most.others && probes.lit <= most.lit;
         ++i) {
        const Hit hit = nearest_hit(rays, start, probe_direction(i, x, y, normal), false);
        const bool dark = meets_dark_back(&hit, lit, near);
        probes.backs += dark;
        probes.others += !dark;
        probes.lit += lit && hit.triangle >= 0 && !hit.front && lit[hit.triangle];
    }
    return probes;
}

// Returns true if at most `most` of the LOOKS probe rays hit dark back faces. Stops as soon as the result is certain.
bool hits_few_backfaces(const Rays *rays, const float3 start, const float3 normal, __global const uchar *lit,
                        const float near, const int most)
{
    const Probes limits = {most, LOOKS - most - 1, LOOKS};
    return probe(rays, start, normal, lit, near, LOOKS, limits).backs <= most;
}
