#pragma once
#include "emitters.cl"
#include "probe_sh.cl"

// Exact spherical harmonics of unoccluded emitters of constant radiance: triangles, and the disks and balls of point
// lights.

// Minimum solid angle of a triangle, sr: below it, sums of edges lose digits, and few samples suffice (computed: 2e-5
// of the light at 1e-4 sr).
#define LEAST_ANGLE 1e-4f

// Returns true if the radiance of an emitter is constant as seen from a probe. With TRANSMISSION, a
// surface is not constant: only its opaque fraction emits, and samples find that fraction.
bool is_constant(__global const Emitter *e)
{
#ifdef TRANSMISSION
    if (e->kind == TRIANGLE && e->triangle >= 0)
        return false;
#endif
    if (e->kind == TRIANGLE)
        return e->uniform;
    return e->kind == POINT && e->radius > 0.0f && e->modulation == 0 && e->cos_half_angle < -1.0f;
}

// Adds radiance times the moments of a region of directions: its solid angle, the integral of directions, and the
// integrals of their squares and products (xx, yy, zz; xy, yz, xz).
void add_moments(ProbeLight *sum, const float3 radiance, const float angle, const float3 first, const float3 squares,
                 const float3 products)
{
    sum->of[0] += BAND_0 * angle * radiance;
    sum->of[1] += BAND_1 * first.y * radiance;
    sum->of[2] += BAND_1 * first.z * radiance;
    sum->of[3] += BAND_1 * first.x * radiance;
    sum->of[4] += PRODUCTS * products.x * radiance;
    sum->of[5] += PRODUCTS * products.y * radiance;
    sum->of[6] += SQUARE * (3.0f * squares.z - angle) * radiance;
    sum->of[7] += PRODUCTS * products.z * radiance;
    sum->of[8] += DIFFERENCE * (squares.x - squares.y) * radiance;
}

// Adds the light of a uniform triangle, times a factor, by its axial moments (Arvo, "Applications of Irradiance Tensors
// to the Simulation of Non-Lambertian Phenomena", 1995). Returns false if it is too small.
bool add_triangle(ProbeLight *sum, __global const Emitter *e, const float3 p, const float3 factor)
{
    const float3 a = vload3(0, e->position) - p, edge1 = vload3(0, e->edge1), edge2 = vload3(0, e->edge2);
    const bool front = dot(cross(edge1, edge2), a) < 0.0f;
    if (!front && (e->triangle < 0 || e->one_sided))
        return true;
    const float3 radiance = factor * (front ? vload3(0, e->strength) : vload3(0, e->back_strength));
    const float3 corners[3] = {normalize(a), normalize(a + edge1), normalize(a + edge2)};
    const float volume = dot(corners[0], cross(corners[1] - corners[0], corners[2] - corners[0]));
    const float angle = 2.0f
        * atan2(fabs(volume),
                1.0f + dot(corners[0], corners[1]) + dot(corners[1], corners[2]) + dot(corners[2], corners[0]));
    if (!(angle > LEAST_ANGLE))
        return false;
    float3 first = (float3)(0.0f), squares = (float3)(0.0f), products = (float3)(0.0f);
    for (int k = 0; k < 3; ++k) {
        const float3 from = corners[k], to = corners[k == 2 ? 0 : k + 1], side = cross(from, to - from);
        const float sine = length(side), cosine = dot(from, to);
        if (!(sine > 0.0f))
            continue;
        // Unit normal of the edge's plane, into the triangle; integral of the directions along the edge.
        const float3 inward = side * (copysign(1.0f, volume) / sine);
        const float3 along = (from + to) * (sine / (1.0f + cosine));
        first += 0.5f * atan2(sine, cosine) * inward;
        squares += along * inward;
        products += 0.5f * (along * inward.yzx + along.yzx * inward);
    }
    // Components of `products` are xy, yz and zx.
    add_moments(sum, radiance, angle, first, (angle + squares) / 3.0f, products / 3.0f);
    return true;
}

// Adds the light of a disk that faces the probe or of a ball, times a factor: a cone of directions around an axis.
// Returns false if the probe is inside the ball.
bool add_disk(ProbeLight *sum, __global const Emitter *e, const float3 p, const float3 factor)
{
    const float3 centre = vload3(0, e->position) - p;
    const float d2 = dot(centre, centre), r2 = e->radius * e->radius;
    if (!e->soft && !(d2 > r2))
        return false;
    const float3 axis = centre * rsqrt(fmax(d2, LEAST));
    const float sin2 = e->soft ? r2 / (d2 + r2) : r2 / d2, cosine = sqrt(1.0f - sin2);
    const float angle = 2.0f * M_PI_F * sin2 / (1.0f + cosine), along = M_PI_F * sin2;
    // Second moments over the cone: of the component along its axis, and of each of the two across.
    const float middle = 2.0f / 3.0f * M_PI_F * sin2 * (1.0f + cosine + cosine * cosine) / (1.0f + cosine);
    const float beside = 0.5f * (angle - middle), differs = middle - beside;
    const float3 radiance = factor * vload3(0, e->strength) / r2;
    add_moments(sum, radiance, angle, along * axis, beside + differs * axis * axis, differs * axis * axis.yzx);
    return true;
}

// Adds the light of an unoccluded emitter of constant radiance, times a factor; returns false if it has to be sampled.
bool add_constant(ProbeLight *sum, __global const Emitter *e, const float3 p, const float3 factor)
{
    return is_constant(e) && (e->kind == TRIANGLE ? add_triangle(sum, e, p, factor) : add_disk(sum, e, p, factor));
}
