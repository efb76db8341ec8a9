#include "bvh_traversal.cl"
#include "receiver.cl"
#include "trace_sample.cl"
#include "hemicube_directions.cl"
#include "cube_faces.cl"

// Radiance of a reflection cube: one ray per sample, and the light that the surface it hits reflects and emits.

// Weight below which no texel around a hit has light.
#define NO_WEIGHT 1e-6f

// Returns E/pi at a hit, bilinear between the texels that have a patch; w of `light` is the weight of a patch.
float3 irradiance_at(const Lightmaps *lightmaps, __global const float4 *light, const int triangle, const float2 w)
{
    __global const float2 *corner = lightmaps->uvs + 3 * triangle;
    const int size = lightmaps->resolution;
    const float2 pixel = (corner[0] * (1.0f - w.x - w.y) + corner[1] * w.x + corner[2] * w.y) * size - 0.5f;
    const float2 low = floor(pixel), f = pixel - low;
    __global const uint *texels = lightmaps->texel_to_patch + (size_t)lightmaps->atlases[triangle] * size * size;
    float4 sum = (float4)(0.0f);
    float3 nearest = (float3)(0.0f);
    for (int i = 0; i < 4; ++i) {
        const int2 step = (int2)(i & 1, i >> 1);
        const int2 at = clamp(convert_int2(low) + step, 0, size - 1);
        const float4 value = light[texels[(size_t)at.y * size + at.x]];
        sum += (step.x ? f.x : 1.0f - f.x) * (step.y ? f.y : 1.0f - f.y) * value.w * (float4)(value.xyz, 1.0f);
        if (step.x == (f.x >= 0.5f) && step.y == (f.y >= 0.5f))
            nearest = value.xyz;
    }
    return sum.w > NO_WEIGHT ? sum.xyz / sum.w : nearest;
}

// Traces the samples start ... end of a cube map: SIDE x SIDE in each texel, texel by texel, face by face. They are
// jittered, so that lights with edges parallel to the texels keep their energy on average.
// material_of: material of each triangle. colors: untextured reflectance and emission of each material, then those of
//     its back face without patches. light: E/pi and weight of patch i at i + 1.
// fronts: number of front triangles. dark: luminance below which a back face indicates the inside of geometry.
// Results, stored from the sample `first` on. hits: surface, or -1 for the sky, and triangle. weights: barycentrics.
//     received: E/pi times `through`; w is 0 if the hit shows the inside of geometry. through: tint of the surfaces
//     that the ray passes. radiance: untextured light.
__kernel void trace_cube(RAYS_ARGUMENTS, __global const float2 *uvs, __global const int *atlases,
                         __global const uint *texel_to_patch, const int resolution, __global const int *backs,
                         __global const int *material_of, __global const float4 *colors, const int material_count,
                         __global const float4 *light, const int fronts, const float dark, __global const float4 *sky,
                         const int sky_width, const int sky_height, const float4 point, const int size, const int first,
                         __global int2 *hits, __global float2 *weights, __global float4 *received,
                         __global float4 *through, __global float4 *radiance, const int start, const int end)
{
    const int i = start + get_global_id(0);
    if (i >= end)
        return;
    const Rays rays = RAYS;
    const Lightmaps lightmaps = {uvs, atlases, texel_to_patch, resolution, backs};
    const int sub = i % (SIDE * SIDE), texel = i / (SIDE * SIDE), row = texel / size % size;
    const uint key = hash(i);
    const float2 lot = convert_float2((uint2)(key, hash(key)) >> 8) * (1.0f / 16777216.0f);
    const float2 at = (float2)(texel % size, row) + ((float2)(sub % SIDE, sub / SIDE) + lot) / SIDE;
    const float3 direction = normalize(face_direction(texel / (size * size), 2.0f * at / size - 1.0f));

    const int to = i - first;
    const Hit hit = nearest_hit(&rays, point.xyz, direction, false);
    float3 tint = (float3)(1.0f);
#ifdef TINTED
    if (hit.tinted)
        tint = tint_of_way(&rays, point.xyz, direction, &hit);
#endif
    through[to] = (float4)(tint, 0.0f);
    if (hit.triangle < 0) {
        hits[to] = (int2)(-1);
        received[to] = (float4)(0.0f, 0.0f, 0.0f, 1.0f);
        radiance[to] = (float4)(tint * background_radiance(direction, sky, (int2)(sky_width, sky_height)).xyz, 0.0f);
        return;
    }
    const Hit shown = turned(&lightmaps, hit);
    const int surface = material_of[shown.triangle] + (shown.front ? 0 : material_count);
    const float3 arriving = shown.front ? irradiance_at(&lightmaps, light, shown.triangle, shown.weights) : 0.0f;
    const float3 leaving = colors[2 * surface].xyz * arriving + colors[2 * surface + 1].xyz;
    const float brightness = dot(arriving + leaving, (float3)(0.2126f, 0.7152f, 0.0722f));
    const bool inside = !shown.front || (shown.triangle >= fronts && brightness < dark);
    hits[to] = (int2)(surface, shown.triangle);
    weights[to] = shown.weights;
    received[to] = (float4)(tint * arriving, inside ? 0.0f : 1.0f);
    radiance[to] = (float4)(tint * leaving, 0.0f);
}
