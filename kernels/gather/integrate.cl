#include "hemicube_directions.cl"

// Integrates rasterised hemicubes in three steps (paper, IV.C and Fig. 3): multiply, reduce rows, reduce columns. Input
// is a texture array whose layers hold `rows` x `columns` hemicubes of n x 3n texels. rgb is radiance; a is 1 for front
// faces and background, and 2 where the background has yet to be looked up.

// Multiplies each texel by the multiplier map. workspace: layers stacked vertically to one tall image. Texels below the
// geometric horizon, where a smooth normal leans over its surface, become 0.
__kernel void multiply(__global const float4 *hemicubes, __global const float *multiplier, __global const Frame *frames,
                       __global float4 *workspace, __global const float4 *sky, const int sky_width,
                       const int sky_height, const int width, const int height, const int layers, const int n)
{
    const int x = get_global_id(0), y = get_global_id(1), layer = get_global_id(2);
    if (x >= width || y >= height || layer >= layers)
        return;
    const size_t texel = ((size_t)layer * height + y) * width + x;
    const int columns = width / n, rows = height / (3 * n);
    const int slot = (layer * rows + y / (3 * n)) * columns + x / n;
    const int tile_x = x % n, tile_y = y % (3 * n);
    const float3 direction = texel_direction(tile_x, tile_y, n);
    __global const Frame *frame = frames + slot;
    const bool above = dot(direction, vload3(0, frame->horizon)) > 0.0f;
    float4 value = hemicubes[texel];
    if (above && value.w > 1.5f) {
        const float3 right = vload3(0, frame->right), up = vload3(0, frame->up), normal = vload3(0, frame->normal);
        const float3 world = direction.x * right + direction.y * up + direction.z * normal;
        value = (float4)(background_radiance(world, sky, (int2)(sky_width, sky_height)).xyz, 1.0f);
    }
    workspace[texel] = above ? value * multiplier[tile_y * n + tile_x] : (float4)(0.0f);
}

// Sums each column of each hemicube: 3n rows become one. One work item per column.
__kernel void reduce_row(__global const float4 *workspace, __global float4 *rows, const int width,
                         const int hemicube_rows, const int n)
{
    const int x = get_global_id(0), hemicube_row = get_global_id(1);
    if (x >= width || hemicube_row >= hemicube_rows)
        return;
    __global const float4 *column = workspace + (size_t)hemicube_row * 3 * n * width + x;
    float4 sum = (float4)(0.0f);
    for (int y = 0; y < 3 * n; ++y)
        sum += column[(size_t)y * width];
    rows[(size_t)hemicube_row * width + x] = sum;
}

// Sums the remaining row of each hemicube by parallel reduction in one work group.
__kernel void reduce_column(__global const float4 *rows, __global float4 *irradiance, const int n,
                            __local float4 *partial)
{
    const int item = get_local_id(0);
    __global const float4 *row = rows + (size_t)get_group_id(0) * n;
    float4 sum = row[item];
    for (int x = item + get_local_size(0); x < n; x += get_local_size(0))
        sum += row[x];
    partial[item] = sum;
    barrier(CLK_LOCAL_MEM_FENCE);
    for (int step = get_local_size(0) / 2; step > 0; step /= 2) {
        if (item < step)
            partial[item] += partial[item + step];
        barrier(CLK_LOCAL_MEM_FENCE);
    }
    if (item == 0)
        irradiance[get_group_id(0)] = partial[0];
}
