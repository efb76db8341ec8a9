#pragma once
#include "receiver.cl"
#include "hemicube_directions.cl"

// Sample patterns over the hemisphere of a patch: viewpoint, directions and weights. COSINE: cosine-distributed
// directions of equal weight; otherwise the texels of a hemicube, weighted by the multiplier map.

typedef struct {
    float3 eye, right, up, normal, horizon;
    uint2 shift;
} View;

#ifdef COSINE
// Increments of the R2 low-discrepancy sequence as fractions of 2^32 (engine/visibility/views/directions.py).
#define R2 (uint2)(3242174889u, 2447445414u)

// Returns the view of a patch. Each patch continues the sample sequence where its predecessor along the Hilbert curve
// ended. Together, neighbours then sample the hemisphere as evenly as one patch with all their samples, so errors
// cancel between them (Ahmed and Wonka, "Screen-Space Blue-Noise Diffusion of Monte Carlo Sampling Error via
// Hierarchical Ordering of Pixels", 2020).
View view_of(const Receiver *r, const int patch, const int samples, const uint salt, const int rotate)
{
    float3 x, y;
    basis(r->normal, &x, &y);
    const uint2 shift = r->rank * samples * R2 + (uint2)(salt, hash(salt));
    const View view = {r->at + r->height * r->geometric, x, y, r->normal, r->geometric, rotate ? shift : (uint2)(0)};
    return view;
}
#else
// Returns the hemicube of a patch, rotated about the normal by a pseudo-random angle that is the same in all iterations
// (engine/visibility/views/hemicube.py: rotations).
View view_of(const Receiver *r, const int patch, const int samples, const uint salt, const int rotate)
{
    float3 x, y;
    basis(r->normal, &x, &y);
    const uint mixed = hash((uint)patch ^ salt);
    const float angle = rotate ? (float)mixed * (1.0f / 2147483648.0f) - 1.0f : 0.0f;
    const float c = cospi(angle), s = sinpi(angle);
    const View view = {
        r->at + r->height * r->geometric, c * x + s * y, c * y - s * x, r->normal, r->geometric, (uint2)(0)};
    return view;
}
#endif

// Returns the world-space direction of sample i.
#ifdef COSINE
float3 sample_direction(const View *view, const int i, __global const uint2 *sequence, const int n)
{
    const float2 u = convert_float2((sequence[i] + view->shift) >> 8) * (1.0f / 16777216.0f);
    const float2 q = disk(u);
    return q.x * view->right + q.y * view->up + sqrt(1.0f - u.x) * view->normal;
}
#else
float3 sample_direction(const View *view, const int i, __global const float *multiplier, const int n)
{
    const float3 d = texel_direction(i % n, i / n, n);
    return d.x * view->right + d.y * view->up + d.z * view->normal;
}
#endif

#ifdef COSINE
#define SAMPLES __global const uint2 *pattern
#define WEIGHT(i) (1.0f / samples)
#else
#define SAMPLES __global const float *pattern
#define WEIGHT(i) pattern[i]
#endif
