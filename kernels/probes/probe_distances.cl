#include "probe_sh.cl"

// Octahedral maps of the distances around probes, by which engines test the visibility of a probe (Majercik et al.,
// "Dynamic Diffuse Global Illumination with Ray-Traced Irradiance Fields", JCGT 8(2), 2019).

// Texels of a map along each side. Rays have the weight cos^50 of the angle to a texel's direction (ibid.).
#define WIDTH 8
#define TEXELS (WIDTH * WIDTH)

float power_50(const float cosine)
{
    const float second = cosine * cosine, fourth = second * second, eighth = fourth * fourth;
    const float sixteenth = eighth * eighth;
    return second * sixteenth * sixteenth * sixteenth;
}

// Returns the direction of a texel's centre in the octahedral map (Cigolle et al., "A Survey of Efficient
// Representations for Independent Unit Vectors", JCGT 3(2), 2014).
float3 octahedral_direction(const int texel)
{
    const float u = (2 * (texel % WIDTH) + 1) / (float)WIDTH - 1.0f,
                v = (2 * (texel / WIDTH) + 1) / (float)WIDTH - 1.0f;
    const float z = 1.0f - fabs(u) - fabs(v);
    const float x = z < 0.0f ? copysign(1.0f - fabs(v), u) : u, y = z < 0.0f ? copysign(1.0f - fabs(u), v) : v;
    return normalize((float3)(x, y, z));
}

// Stores the weighted means of distance and squared distance for each texel of each probe. distances: of each sample,
// metres; those above the limit count as the limit.
__kernel void map_distances(__global const float4 *rotations, __global const float4 *directions, const int samples,
                            __global const float *distances, const float limit, __global float2 *maps, const int start,
                            const int end)
{
    const int item = start + get_global_id(0);
    if (item >= end)
        return;
    const int probe = item / TEXELS;
    const float4 rotation = rotations[probe];
    const float3 axis = rotated((float4)(-rotation.xyz, rotation.w), octahedral_direction(item % TEXELS));
    __global const float *own = distances + (size_t)probe * samples;
    float2 sum = (float2)(0.0f);
    float total = 0.0f;
    for (int i = 0; i < samples; ++i) {
        const float weight = power_50(fmax(dot(axis, directions[i].xyz), 0.0f));
        const float distance = fmin(own[i], limit);
        sum += weight * (float2)(distance, distance * distance);
        total += weight;
    }
    maps[item] = sum / total;
}
