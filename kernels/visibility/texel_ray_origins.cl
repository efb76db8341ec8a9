#pragma once
#include "bvh_traversal.cl"
#include "receiver.cl"

// Where rays of a texel start: at points of it that no face parts from its centre. What lies beyond such a face is
// inside of something, or on the other side of a wall: it has other light, which nobody sees there.

// Steps of the places of samples in a texel, fractions of the range of integers: the golden ratio's, and that of the
// root of 2.
#define PLACES (uint2)(2654435769u, 1779033703u)

// Where the ray of a sample starts in a texel, 0 to 1 along u and v.
float2 place_of_sample(const int i, const uint2 shift)
{
    return convert_float2(((uint)i * PLACES + shift) >> 8) * (1.0f / 16777216.0f);
}

// Whether a face stands between the centre of a texel, or a place of it, and another place, in its plane.
bool is_parted(const Rays *rays, const Receiver *r, const float3 from, const float3 to)
{
    return largest(transmittance(rays, BOUNCE, from + r->height * r->geometric, to - from, 1.0f)) < 0.5f;
}

// Whether a face crosses a texel: it meets one of the diagonals. These end a little before the corners, where faces
// of texels that charts are aligned to end: by rounding, such a face would cross or not.
bool is_crossed(const Rays *rays, const Receiver *r)
{
    const float3 rising = 0.499f * (r->edge_u + r->edge_v), falling = 0.499f * (r->edge_u - r->edge_v);
    return is_parted(rays, r, r->at - rising, r->at + rising) || is_parted(rays, r, r->at - falling, r->at + falling);
}

// Places whose way from the centre, this much longer, meets no face: by rounding, those on a face may lie beyond it.
#define BEYOND 1.01f

// Whether a place of a texel that a face crosses is on the centre's side of it.
bool is_with_centre(const Rays *rays, const Receiver *r, const float3 p)
{
    return !is_parted(rays, r, r->at, r->at + BEYOND * (p - r->at));
}

// A point of the texel (`point_of_texel`); where a face parts it from the centre, the one opposite, or the centre.
float3 jittered_origin(const Rays *rays, const Receiver *r, const float2 at)
{
    const float3 p = point_of_texel(r, at);
    if (!r->crossed || is_with_centre(rays, r, p))
        return p;
    const float3 opposite = 2.0f * r->at - p;
    return in_triangle(r, opposite) && is_with_centre(rays, r, opposite) ? opposite : r->at;
}
