#pragma once
#include "bvh_traversal.cl"
#include "receiver.cl"

// Jittered ray origins within a texel. Points that another face separates from the texel's centre are avoided: they lie
// inside an object or on the far side of a wall, where the light differs and is never displayed.

// Increments of a 2D Weyl sequence, as fractions of 2^32: golden ratio - 1 and sqrt(2) - 1.
#define PLACES (uint2)(2654435769u, 1779033703u)

// Returns the position of sample i in the texel, 0..1 along u and v.
float2 place_of_sample(const int i, const uint2 shift)
{
    return convert_float2(((uint)i * PLACES + shift) >> 8) * (1.0f / 16777216.0f);
}

// Returns true if a face separates two points of the texel, tested by a ray in the texel's plane.
bool is_parted(const Rays *rays, const Receiver *r, const float3 from, const float3 to)
{
    return largest(transmittance(rays, BOUNCE, from + r->height * r->geometric, to - from, 1.0f)) < 0.5f;
}

// Returns true if a face crosses the texel, that is, one of its diagonals. The diagonals end just before the corners:
// faces of objects whose charts are aligned to texels end exactly there, and rounding would decide.
bool is_crossed(const Rays *rays, const Receiver *r)
{
    const float3 rising = 0.499f * (r->edge_u + r->edge_v), falling = 0.499f * (r->edge_u - r->edge_v);
    return is_parted(rays, r, r->at - rising, r->at + rising) || is_parted(rays, r, r->at - falling, r->at + falling);
}

// Factor by which the test ray from the centre is extended, because a point on a face may lie beyond it by rounding.
#define BEYOND 1.01f

// Returns true if a point of the texel is on the same side of crossing faces as the centre.
bool is_with_centre(const Rays *rays, const Receiver *r, const float3 p)
{
    return !is_parted(rays, r, r->at, r->at + BEYOND * (p - r->at));
}

// Returns a point of the texel (point_of_texel). If a face separates it from the centre, returns the mirrored point or
// the centre instead.
float3 jittered_origin(const Rays *rays, const Receiver *r, const float2 at)
{
    const float3 p = point_of_texel(r, at);
    if (!r->crossed || is_with_centre(rays, r, p))
        return p;
    const float3 opposite = 2.0f * r->at - p;
    return in_triangle(r, opposite) && is_with_centre(rays, r, opposite) ? opposite : r->at;
}
