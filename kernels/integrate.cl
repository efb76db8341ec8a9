// Integration of hemicubes in three steps (paper, IV.C and Fig. 3). A texture array of
// `layers` layers, each `rows` x `columns` hemicubes of 3n x n texels, becomes one value a hemicube.
// rgb is radiance; a is 1 where the front of a surface or the surroundings are seen.

// Workspace: layers stacked on top of each other, so that the later steps see one tall image.
__kernel void multiply(__global const float4 *hemicubes, __global const float *multiplier,
                       __global float4 *workspace, const int width, const int height, const int n)
{
    const int x = get_global_id(0), y = get_global_id(1), layer = get_global_id(2);
    if (x >= width || y >= height)
        return;
    const size_t texel = ((size_t)layer * height + y) * width + x;
    workspace[texel] = hemicubes[texel] * multiplier[(y % (3 * n)) * n + x % n];
}

// One work item adds up one column of one hemicube: 3n rows become a single row.
__kernel void reduce_row(__global const float4 *workspace, __global float4 *rows, const int width, const int n)
{
    const int x = get_global_id(0), hemicube_row = get_global_id(1);
    if (x >= width)
        return;
    __global const float4 *column = workspace + (size_t)hemicube_row * 3 * n * width + x;
    float4 sum = (float4)(0.0f);
    for (int y = 0; y < 3 * n; ++y)
        sum += column[(size_t)y * width];
    rows[(size_t)hemicube_row * width + x] = sum;
}

// One work group of n items halves the number of columns of one hemicube until one value is left.
__kernel void reduce_column(__global const float4 *rows, __global float4 *irradiance, __local float4 *partial)
{
    const int item = get_local_id(0);
    partial[item] = rows[get_global_id(0)];
    barrier(CLK_LOCAL_MEM_FENCE);
    for (int step = get_local_size(0) / 2; step > 0; step /= 2) {
        if (item < step)
            partial[item] += partial[item + step];
        barrier(CLK_LOCAL_MEM_FENCE);
    }
    if (item == 0)
        irradiance[get_group_id(0)] = partial[0];
}
