#include "texture.cl"

// Textured parts of the light in the samples of a reflection cube.

// Adds color x texture x factor to the radiance of chosen samples. places: row in `corners` of the triangle that each
// hits. corners: texture UVs of the triangles' corners. factor: float4 of each sample, E/pi for reflected light or the
// tint for emitted light.
__kernel void add_textured(__global const int *chosen, __global const int *places, __global const float2 *weights,
                           __global const float2 *corners, __global const float *pixels, const int width,
                           const int height, const int extension, const int smooth, const int srgb, const float4 color,
                           __global const float4 *factor, __global float4 *radiance, const int count)
{
    const int i = get_global_id(0);
    if (i >= count)
        return;
    const int sample = chosen[i];
    const float2 w = weights[sample];
    const float2 uv = on_texture(corners + 3 * places[i], (float3)(1.0f - w.x - w.y, w.x, w.y));
    const Image image = {pixels, width, height, extension};
    radiance[sample].xyz += color.xyz * shown(image, uv, smooth, srgb) * factor[sample].xyz;
}
