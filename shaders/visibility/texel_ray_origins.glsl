#pragma once
#include "bvh_traversal.glsl"
#include "receiver.glsl"

// Ray origins of a texel: points of it that no face parts from its centre. As kernels/visibility/texel_ray_origins.cl.

// Steps of the places of samples in a texel, fractions of the range of integers: the golden ratio's, and that of the
// root of 2.
#define PLACES uvec2(2654435769u, 1779033703u)

// The origin of a sample's ray in its texel, 0 to 1 along u and v.
vec2 place_of_sample(const int i, const uvec2 shift)
{
    return vec2((uint(i) * PLACES + shift) >> 8) * (1.0 / 16777216.0);
}

// Whether a face stands between the centre of a texel, or a place of it, and another place, in its plane.
bool is_parted(const Receiver r, const vec3 from, const vec3 to)
{
    return largest(transmittance(BOUNCE, from + r.height * r.geometric, to - from, 1.0)) < 0.5;
}

// Whether a face crosses a texel: it meets one of the diagonals, which end a little before the corners.
bool is_crossed(const Receiver r)
{
    for (int i = 0; i < 2; ++i) {
        vec3 diagonal = 0.499 * (r.edge_u + (i == 0 ? r.edge_v : -r.edge_v));
        if (is_parted(r, r.at - diagonal, r.at + diagonal))
            return true;
    }
    return false;
}

// Places whose way from the centre, this much longer, meets no face: by rounding, those on a face may lie beyond it.
#define BEYOND 1.01

// Whether a place of a texel that a face crosses is on the centre's side of it.
bool is_with_centre(const Receiver r, const vec3 p) { return !is_parted(r, r.at, r.at + BEYOND * (p - r.at)); }

// A point of the texel (`point_of_texel`); where a face parts it from the centre, the one opposite, or the centre.
vec3 jittered_origin(const Receiver r, const vec2 at)
{
    vec3 p = point_of_texel(r, at);
    if (!r.crossed)
        return p;
    // One place in the code for both rays: drivers inline every call.
    for (int i = 0; i < 2; ++i) {
        if ((i == 0 || in_triangle(r, p)) && is_with_centre(r, p))
            return p;
        p = 2.0 * r.at - p;
    }
    return r.at;
}
