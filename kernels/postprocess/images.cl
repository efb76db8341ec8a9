#include "texel.cl"

// Unpacks texels of one or three channels to a float4 image; 0 where `known` is 0.
__kernel void spread_channels(__global const float *narrow, const int channels, __global const uchar *known,
                              const uint number, __global float4 *images, const uint count)
{
    const uint i = get_global_id(0);
    if (i >= count)
        return;
    __global float4 *image = images + (size_t)number * count;
    if (!known[i])
        image[i] = (float4)(0.0f);
    else
        image[i] = channels == 1 ? (float4)((float3)(narrow[i]), 0.0f) : (float4)(vload3(i, narrow), 0.0f);
}

__kernel void pack_channels(__global const float4 *images, __global float *narrow, const uint count)
{
    const size_t i = get_global_id(1) * count + get_global_id(0);
    if (get_global_id(0) < count)
        vstore3(images[i].xyz, i, narrow);
}

// Writes patch values, rows `stride` apart, to the texels of an image; 0 for texels without a patch. One work item per
// channel.
__kernel void pick_patches(__global const float *values, const int stride, const int channels,
                           __global const uint *entries, __global float *texels, const uint count)
{
    const uint i = get_global_id(0);
    if (i >= count)
        return;
    const uint entry = entries[i / channels];
    texels[i] = entry == 0 ? 0.0f : values[(size_t)(entry - 1) * stride + i % channels];
}

// Overwrites some texels of an image; places[i] is NOWHERE for values to skip.
#define NOWHERE 0xffffffffu
__kernel void put_texels(__global const uint *places, __global const float4 *light, const int channels,
                         __global float *texels, const uint count)
{
    const uint i = get_global_id(0);
    if (i >= count || places[i] == NOWHERE)
        return;
    if (channels == 1)
        texels[places[i]] = light[i].x;
    else
        vstore3(light[i].xyz, places[i], texels);
}

// Reads the chosen texels of an output as float4.
__kernel void take_texels(__global const float *texels, __global const uint *chosen, const int channels,
                          const uint number, __global float4 *light, const uint count)
{
    const uint i = get_global_id(0);
    if (i >= count)
        return;
    const size_t texel = chosen[i];
    const float3 shown = channels == 1 ? (float3)(texels[texel]) : vload3(texel, texels);
    light[(size_t)number * count + i] = (float4)(shown, 0.0f);
}

// Finds the largest absolute value by an atomic maximum of float bits. Bits of non-negative floats have the order of
// the floats.
#define EACH 64
__kernel void largest_value(__global const float *values, const int stride, const int channels, const uint count,
                            __global uint *largest)
{
    uint most = 0;
    for (int k = 0; k < EACH; ++k) {
        const size_t i = k * get_global_size(0) + get_global_id(0);
        if (i < count)
            most = max(most, as_uint(fabs(values[i / channels * stride + i % channels])));
    }
    if (most)
        atomic_max(largest, most);
}
