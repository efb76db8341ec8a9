#pragma once
#include "bvh_traversal.glsl"
#include "receiver.glsl"

// Jittered ray origins within a texel. Points that another face separates from the texel's centre are avoided. The same
// algorithm as kernels/visibility/texel_ray_origins.cl.

// Increments of a 2D Weyl sequence, as fractions of 2^32: golden ratio - 1 and sqrt(2) - 1.
#define PLACES uvec2(2654435769u, 1779033703u)

// Returns the position of sample i in the texel, 0..1 along u and v.
vec2 place_of_sample(const int i, const uvec2 shift)
{
    return vec2((uint(i) * PLACES + shift) >> 8) * (1.0 / 16777216.0);
}

// Returns true if a face separates two points of the texel, tested by a ray in the texel's plane.
bool is_parted(const Receiver r, const vec3 from, const vec3 to)
{
    return largest(transmittance(BOUNCE, from + r.height * r.geometric, to - from, 1.0)) < 0.5;
}

// Returns true if a face crosses the texel, that is, one of its diagonals. The diagonals end just before the corners.
bool is_crossed(const Receiver r)
{
    for (int i = 0; i < 2; ++i) {
        vec3 diagonal = 0.499 * (r.edge_u + (i == 0 ? r.edge_v : -r.edge_v));
        if (is_parted(r, r.at - diagonal, r.at + diagonal))
            return true;
    }
    return false;
}

// Factor by which the test ray from the centre is extended, because a point on a face may lie beyond it by rounding.
#define BEYOND 1.01

// Returns true if a point of the texel is on the same side of crossing faces as the centre.
bool is_with_centre(const Receiver r, const vec3 p) { return !is_parted(r, r.at, r.at + BEYOND * (p - r.at)); }

// Returns a point of the texel (`point_of_texel`). If a face separates it from the centre, returns the mirrored point
// or the centre instead.
vec3 jittered_origin(const Receiver r, const vec2 at)
{
    vec3 p = point_of_texel(r, at);
    if (!r.crossed)
        return p;
    // Both rays are traced at one place of the code, because drivers inline every call.
    for (int i = 0; i < 2; ++i) {
        if ((i == 0 || in_triangle(r, p)) && is_with_centre(r, p))
            return p;
        p = 2.0 * r.at - p;
    }
    return r.at;
}
