#pragma once

// L1 of irradiance: a vector l1 per channel with E(n')/pi = E(n)/pi + l1 . (n' - n) for normals n' near n (normal
// maps).

// L1 of a patch: rgb for each world axis. Without DIRECTIONAL, additions compile to nothing.
typedef struct {
    float4 x, y, z;
} L1;

// Returns factors x and y as functions of c = d . n: light from a unit direction d with E(n)/pi = 1 has l1 = x (d - c
// n) + y n. They are a least-squares fit over normals of a rough surface (Beckmann and Spizzichino 1963, slope 0.4).
// The fitted function is the cosine times the bump shadowing term of Estevez, Lecocq and Stein ("A Microfacet-Based
// Shadowing Function to Solve the Bump Terminator Problem", Ray Tracing Gems, 2019), as in Cycles since Blender 4.5.
// Stored as polynomials; tests/gpu/test_tilt.py computes them again.
#ifndef PROJECTED
float2 l1_factors(const float c)
{
    return (
        float2)(6.545f
                    + c
                        * (-28.9163f
                           + c * (98.5565f + c * (-214.3111f + c * (267.2386f + c * (-173.8481f + c * 45.7424f))))),
                -5.2663f
                    + c
                        * (45.5535f
                           + c * (-138.9425f + c * (238.2109f + c * (-245.3737f + c * (142.2527f - c * 35.4425f))))));
}
#else
// PROJECTED: projection onto spherical harmonics instead, with the mean radiance along the normal and twice the mean of
//     radiance times direction across it. Grazing light is damped, because it would add noise.
#define LEAST_COSINE 0.015625f
float2 l1_factors(const float c) { return (float2)(0.5f, 0.25f) / fmax(c, LEAST_COSINE); }
#endif

// Returns l1 of light from a direction of any length.
float3 l1_of_direction(const float3 direction, const float3 normal)
{
#ifdef DIRECTIONAL
    const float3 d = normalize(direction);
    const float c = clamp(dot(d, normal), 0.0f, 1.0f);
    const float2 factors = l1_factors(c);
    return factors.x * d + (factors.y - factors.x * c) * normal;
#else
    return (float3)(0.0f);
#endif
}

// Adds light, E(n)/pi, with its l1_of_direction.
void add_l1(L1 *l1, const float3 light, const float3 tilt)
{
#ifdef DIRECTIONAL
    l1->x.xyz += tilt.x * light;
    l1->y.xyz += tilt.y * light;
    l1->z.xyz += tilt.z * light;
#endif
}
