#pragma once
// L1 of irradiance: a vector l1 per channel with E(n')/pi = E(n)/pi + l1 . (n' - n) for normals n' near n (normal
// maps). kernels/visibility/irradiance_l1.cl explains the polynomials.

// L1 of a patch: rgb for each world axis; stays 0 without DIRECTIONAL.
struct L1 {
    vec3 x, y, z;
};

#ifdef PROJECTED
// Grazing light is damped in spherical harmonics, because it would add noise.
#define LEAST_COSINE 0.015625
vec2 l1_factors(const float c) { return vec2(0.5, 0.25) / max(c, LEAST_COSINE); }
#else
vec2 l1_factors(const float c)
{
    return vec2(
        6.545 + c * (-28.9163 + c * (98.5565 + c * (-214.3111 + c * (267.2386 + c * (-173.8481 + c * 45.7424))))),
        -5.2663 + c * (45.5535 + c * (-138.9425 + c * (238.2109 + c * (-245.3737 + c * (142.2527 - c * 35.4425))))));
}
#endif

// Returns l1 of light from a direction of any length.
vec3 l1_of_direction(const vec3 direction, const vec3 normal)
{
#ifdef DIRECTIONAL
    vec3 d = normalize(direction);
    float c = clamp(dot(d, normal), 0.0, 1.0);
    vec2 factors = l1_factors(c);
    return factors.x * d + (factors.y - factors.x * c) * normal;
#else
    return vec3(0.0);
#endif
}

// Adds light, E(n)/pi, with its `l1_of_direction`.
void add_l1(inout L1 l1, const vec3 light, const vec3 tilt)
{
#ifdef DIRECTIONAL
    l1.x += tilt.x * light;
    l1.y += tilt.y * light;
    l1.z += tilt.z * light;
#endif
}
