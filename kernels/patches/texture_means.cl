#include "texture.cl"

// Box filters of textures: mean over the texels of patches, and downsampling of images.

// Multiplies the values of `count` patches by the mean of a texture over their texels, from SAMPLES x SAMPLES points.
// Only points within the patch's triangle count; if there are none, the patch's own point does.
// places: index of each triangle in `steps` (two barycentric steps per triangle) and `corners` (three UVs per
//     triangle).
__kernel void texture_mean(__global const int *triangles, __global const float *barycentrics,
                           __global const int *places, __global const int *patches, __global const float *steps,
                           __global const float2 *corners, __global const float *pixels, const int width,
                           const int height, const int extension, const int smooth, const int srgb,
                           __global float *values, const int count)
{
    const int i = get_global_id(0);
    if (i >= count)
        return;
    const int patch = patches[i], place = places[triangles[patch]];
    const float3 middle = vload3(patch, barycentrics);
    const float3 along_u = vload3(2 * place, steps), along_v = vload3(2 * place + 1, steps);
    const Image image = {pixels, width, height, extension};
    float3 total = 0.0f;
    int inside = 0;
    for (int v = 0; v < SAMPLES; ++v)
        for (int u = 0; u < SAMPLES; ++u) {
            const float2 offset = ((float2)(u, v) + 0.5f) / SAMPLES - 0.5f;
            const float3 w = middle + offset.x * along_u + offset.y * along_v;
            if (w.x >= 0.0f && w.y >= 0.0f && w.z >= 0.0f) {
                total += shown(image, on_texture(corners + 3 * place, w), smooth, srgb);
                ++inside;
            }
        }
    const float3 mean =
        inside > 0 ? total / inside : shown(image, on_texture(corners + 3 * place, middle), smooth, srgb);
    vstore3(vload3(patch, values) * mean, patch, values);
}

// Returns the fraction of new pixel `made` (of `made_size`) that old pixel `old` (of `size`) covers along one axis.
float covered(const long old, const long size, const long made, const long made_size)
{
    return (float)(min((old + 1) * made_size, (made + 1) * size) - max(old * made_size, made * size)) / size;
}

// Downsamples an image with a box filter: each new pixel is the area-weighted mean of old ones. pixels: rows from
// `first` on. Computes `count` new pixels from `start` on.
__kernel void downsample(__global const float *pixels, const int first, const int width, const int height,
                         const int new_width, const int new_height, const int srgb, __global float *image,
                         const int start, const int count)
{
    const int i = get_global_id(0);
    if (i >= count)
        return;
    const long column = (start + i) % new_width, row = (start + i) / new_width;
    const long last_row = (row + 1) * height, last_column = (column + 1) * width;
    float3 total = 0.0f;
    for (long y = row * height / new_height; y * new_height < last_row; ++y) {
        float3 line = 0.0f;
        for (long x = column * width / new_width; x * new_width < last_column; ++x) {
            const float3 pixel = vload3((size_t)(y - first) * width + x, pixels);
            line += covered(x, width, column, new_width) * (srgb ? linear_of(pixel) : pixel);
        }
        total += covered(y, height, row, new_height) * line;
    }
    vstore3(total, start + i, image);
}
