#pragma once
#include "bvh_traversal.cl"
#include "receiver.cl"
#include "visibility_sample.cl"
#include "view_samples.cl"
#include "texel_ray_origins.cl"

// Traces one visibility sample: finds the patch that a ray from a patch hits first.

typedef struct {
    __global const float2 *uvs;           // of each corner of each triangle on its lightmap
    __global const int *atlases;          // of each triangle
    __global const uint *texel_to_patch;  // patch + 1 of each texel of each lightmap, or 0
    int resolution;
    __global const int *backs;  // twin triangle of each triangle's back face, or -1; null if none
} Lightmaps;

#ifdef TINTED
#define RAY_TINTS(rays) (rays).tints

// The 3 x 3 x 3 lattice of tints at the end of the palette, its first index, and the tolerance at which tints are equal
// (engine/scene/tints.py).
#define LEVELS 3
#define EXACT (64 - LEVELS * LEVELS * LEVELS)
#define SAME_TINT 1e-4f

// Returns the palette index of a tint. Tints that are not in the palette are dithered to a corner of their lattice cell
// with trilinear probabilities, so that the mean is exact.
uint index_of_tint(const Rays *rays, const float3 tint, const uint key)
{
    const int count = (int)rays->tints[0].w;
    for (int i = 0; i < count; ++i) {
        const float3 off = fabs(tint - rays->tints[i].xyz);
        if (fmax(off.x, fmax(off.y, off.z)) < SAME_TINT)
            return i;
    }
    const float3 cell = clamp(tint, 0.0f, 1.0f) * (float)(LEVELS - 1);
    const uint3 low = convert_uint3(cell);
    const uint3 lots = (uint3)(hash(key), hash(key + 0x9e3779b9u), hash(key + 0x3c6ef372u)) >> 8;
    const float3 lot = convert_float3(lots) * (1.0f / 16777216.0f);
    const uint3 corner = low + select((uint3)(0), (uint3)(1), lot < cell - convert_float3(low));
    return EXACT + corner.x + LEVELS * (corner.y + LEVELS * corner.z);
}
#else
#define RAY_TINTS(rays) 0
#endif

// Replaces a back-face hit by a front-face hit of the twin triangle if back faces of this triangle have patches. The
// twin has the corners in opposite order.
Hit turned(const Lightmaps *lightmaps, Hit hit)
{
    if (hit.front || !lightmaps->backs || lightmaps->backs[hit.triangle] < 0)
        return hit;
    hit.triangle = lightmaps->backs[hit.triangle];
    hit.weights = hit.weights.yx;
    hit.front = true;
    return hit;
}

// Returns the index of the texel that a ray hits, among the texels of all lightmaps.
size_t texel_of_hit(const Lightmaps *lightmaps, const Hit shown)
{
    __global const float2 *corner = lightmaps->uvs + 3 * shown.triangle;
    const float2 w = shown.weights;
    const float2 uv = corner[0] * (1.0f - w.x - w.y) + corner[1] * w.x + corner[2] * w.y;
    const int2 texel = clamp(convert_int2(uv * lightmaps->resolution), 0, lightmaps->resolution - 1);
    const size_t row = (size_t)lightmaps->atlases[shown.triangle] * lightmaps->resolution + texel.y;
    return row * lightmaps->resolution + texel.x;
}

// Returns the item-buffer entry of a ray's nearest hit: patch + 1, with the BACK bit for back faces, or SKY. tint:
// palette index of the colour of transparent surfaces passed (visibility_sample.cl).
uint sample_of_hit(const Rays *rays, const Lightmaps *lightmaps, const float3 origin, const float3 direction,
                   const Hit hit, uint *tint)
{
    *tint = 0;
#ifdef TINTED
    if (hit.tinted) {
        const uint3 way = as_uint3(direction);
        const uint key = hash(way.x ^ hash(way.y ^ hash(way.z ^ as_uint(origin.x))));
        *tint = index_of_tint(rays, tint_of_way(rays, origin, direction, &hit), key);
    }
#endif
    if (hit.triangle < 0)
        return SKY;
    const Hit shown = turned(lightmaps, hit);
    return lightmaps->texel_to_patch[texel_of_hit(lightmaps, shown)] | (shown.front ? 0u : BACK);
}

// Traces a ray and returns its item-buffer entry.
uint trace_sample(const Rays *rays, const Lightmaps *lightmaps, const float3 origin, const float3 direction, uint *tint)
{
    return sample_of_hit(rays, lightmaps, origin, direction, nearest_hit(rays, origin, direction, false), tint);
}

// Ray origin of a sample and the index of its position in the texel; -1 before the first sample.
typedef struct {
    float3 at;
    int place;
} Eye;

#ifdef COSINE
// Number of distinct origins in a texel that a face crosses. Each costs rays of its own, so consecutive samples share
// one.
#define PLACES_IF_CROSSED 32

// Jitters the ray origin over the texel: a patch stores the mean irradiance of its texel.
void advance_origin(Eye *eye, const View *view, const Rays *rays, const Receiver *r, const int i, const int samples)
{
    const int place = r->crossed ? i * PLACES_IF_CROSSED / samples : i;
    if (place == eye->place)
        return;
    const uint2 shift = (uint2)(hash(r->rank + view->shift.x), hash(r->rank + view->shift.y));
    eye->place = place;
    eye->at = view->eye + jittered_origin(rays, r, place_of_sample(place, shift)) - r->at;
}
#else
// A hemicube has a single viewpoint above the texel's centre.
void advance_origin(Eye *eye, const View *view, const Rays *rays, const Receiver *r, const int i, const int samples)
{
    eye->at = view->eye;
}
#endif

#define LOOK_ARGUMENTS \
    RAYS_ARGUMENTS, __global const ReceiverRecord *receivers, __global const float2 *uvs, __global const int *atlases, \
        __global const uint *texel_to_patch, const int resolution, __global const int *backs, \
        __global const float4 *emission, const uint outside, SAMPLES, const int samples, const int n, const uint salt, \
        const int rotate
