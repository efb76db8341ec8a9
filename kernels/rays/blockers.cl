#pragma once
#include "bvh_traversal.cl"
#include "receiver.cl"
#include "shaft.cl"

// Candidate blockers between one texel or probe and one triangle of a light, by shaft culling (Haines and Wallace 1991;
// shaft.cl). find_blockers stores the triangles that reach into the convex hull of texel and triangle, so that shadow
// rays test only them.

#if PACKET == 8
// Slack of the shaft for rounding, as a fraction of the distance to the emitter's farthest corner (chosen).
#define SHAFT_SLACK 1e-5f

// Builds the shaft around a texel and a triangle, which has a corner and two edges. It ends just before the planes of
// both, because shadow rays do the same. Returns false if no safe shaft exists: ray origins are offset to a smooth
// surface, the texel lies near the triangle's plane, or the triangle is as small as rounding errors.
bool make_shaft(const float3 corner, const float3 edge1, const float3 edge2, const Receiver *r, Shaft *shaft)
{
    const float3 start = r->at + r->height * r->geometric, across = r->edge_u + r->edge_v,
                 along = r->edge_u - r->edge_v;
    const float radius = 0.501f * sqrt(fmax(dot(across, across), dot(along, along)));
    const float3 face = cross(edge1, edge2), a = corner - start, corners[3] = {a, a + edge1, a + edge2};
    const float twice = length(face);
    if (r->lifted > 0.0f || !(twice > 0.0f))
        return false;
    const float3 towards = (dot(face, a) > 0.0f ? face : -face) / twice;
    const float distance = dot(towards, a);
    if (!(distance > 2.0f * radius))
        return false;
    shaft->start = start;
    shaft->across = 0.501f * r->edge_u;
    shaft->along = 0.501f * r->edge_v;
    shaft->slack = SHAFT_SLACK * sqrt(fmax(fmax(dot(a, a), dot(corners[1], corners[1])), dot(corners[2], corners[2])));
    for (int k = 0; k < 3; ++k) {
        shaft->corners[k] = corners[k];
        const float3 from = corners[k], to = corners[k == 2 ? 0 : k + 1], other = corners[k == 0 ? 2 : k - 1];
        const float3 side = cross(from, to);
        const float size = length(side), third = dot(side, other);
        if (!(fabs(third) > 1e-5f * size * length(other)))
            return false;
        shaft->normals[k] = side * ((third > 0.0f ? -1.0f : 1.0f) / size);
        shaft->most[k] = radius;
    }
    shaft->normals[3] = -r->geometric;
    shaft->most[3] = 0.5f * r->height;
    shaft->normals[4] = towards;
    shaft->most[4] = distance - 1e-4f * (distance - radius);
    return true;
}

__attribute__((noinline)) void find_blockers(const Rays *rays, const float3 corner, const float3 edge1,
                                             const float3 edge2, const Receiver *r, Blockers *blockers)
{
    Shaft shaft;
    blockers->count = UNKNOWN_BLOCKERS;
    if (make_shaft(corner, edge1, edge2, r, &shaft))
        find_within(rays, &shaft, blockers);
}
#else
void find_blockers(const Rays *rays, const float3 corner, const float3 edge1, const float3 edge2, const Receiver *r,
                   Blockers *blockers)
{
    blockers->count = UNKNOWN_BLOCKERS;
}
#endif

// Finds the blockers between a texel and an emissive triangle.
void find_triangle_blockers(const Rays *rays, __global const Emitter *e, const Receiver *r, Blockers *blockers)
{
    find_blockers(rays, vload3(0, e->position), vload3(0, e->edge1), vload3(0, e->edge2), r, blockers);
}
