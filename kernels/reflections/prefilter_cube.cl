#include "receiver.cl"
#include "cube_faces.cl"

// GGX prefilter of a cube map for one roughness, with normal = view = reflection (Karis, "Real Shading in Unreal Engine
// 4", SIGGRAPH 2013).

// Returns the radiance of one level of the mip pyramid in a direction, bilinear; faces have a border of one texel.
// level: first texel and face width without border.
float3 level_at(__global const float4 *texels, const int2 level, const int face, const float2 at)
{
    const int size = level.y, width = size + 2;
    const float2 pixel = clamp(0.5f * (at + 1.0f) * size + 0.5f, 0.0f, size + 0.999f);
    const int2 low = convert_int2(pixel);
    const float2 f = pixel - convert_float2(low);
    __global const float4 *corner = texels + level.x + (face * width + low.y) * width + low.x;
    return mix(mix(corner[0].xyz, corner[1].xyz, f.x), mix(corner[width].xyz, corner[width + 1].xyz, f.x), f.y);
}

// Filters texels start ... end of faces of width `size`. texels, levels: mip pyramid. samples: directions around the
// normal, whose z is also their weight, and in w the level of the pyramid at which each is read.
__kernel void prefilter_cube(__global const float4 *texels, __global const int2 *levels, const int level_count,
                             __global const float4 *samples, const int sample_count, const int size,
                             __global float4 *filtered, const int start, const int end)
{
    const int i = start + get_global_id(0);
    if (i >= end)
        return;
    const float2 texel = (float2)(i % size, i / size % size);
    const float3 z = normalize(face_direction(i / (size * size), 2.0f * (texel + 0.5f) / size - 1.0f));
    float3 x, y, sum = (float3)(0.0f);
    basis(z, &x, &y);
    float total = 0.0f;
    for (int k = 0; k < sample_count; ++k) {
        const float4 s = samples[k];
        float2 at;
        const int face = face_of(s.x * x + s.y * y + s.z * z, &at);
        const int low = clamp((int)s.w, 0, level_count - 1), high = min(low + 1, level_count - 1);
        sum += s.z * mix(level_at(texels, levels[low], face, at), level_at(texels, levels[high], face, at), s.w - low);
        total += s.z;
    }
    filtered[i] = (float4)(sum / total, 0.0f);
}
