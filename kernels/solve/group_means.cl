// Computes means over patch groups (patch_groups.cl); each group lies within one square of `width` texels. Sums are
// double where the device supports it.

#ifdef cl_khr_fp64
#pragma OPENCL EXTENSION cl_khr_fp64 : enable
typedef double Sum;
#else
typedef float Sum;
#endif

// Runs one work item per channel of each group. chosen: representative patch of each group; pages: its lightmap.
// values: rows of `stride` floats; total: 1 for the mean times the number of members.
__kernel void group_means(__global const uint *texel_to_patch, const int resolution, const int width,
                          __global const int *texels, __global const uint *leaders, __global const uint *chosen,
                          __global const int *pages, __global const float *values, const int stride,
                          const int channels, const int total, __global float *means, const uint count)
{
    const uint i = get_global_id(0);
    if (i >= count)
        return;
    const uint leader = chosen[i / channels];
    const int texel = texels[leader], x0 = texel % resolution / width * width, y0 = texel / resolution / width * width;
    const size_t page = (size_t)pages[i / channels] * resolution * resolution;
    Sum sum = 0, members = 0;
    for (int y = y0; y < min(y0 + width, resolution); ++y)
        for (int x = x0; x < min(x0 + width, resolution); ++x) {
            const uint entry = texel_to_patch[page + (size_t)y * resolution + x];
            if (entry == 0 || texels[entry - 1] != y * resolution + x || leaders[entry - 1] != leader)
                continue;
            sum += values[(size_t)(entry - 1) * stride + i % channels];
            members += 1;
        }
    const float mean = sum / members;
    means[i] = total ? mean * (float)members : mean;
}

// Numbers the representatives: numbers[chosen[i]] = i + 1.
__kernel void number_groups(__global const uint *chosen, __global uint *numbers, const int count)
{
    const int i = get_global_id(0);
    if (i < count)
        numbers[chosen[i]] = i + 1;
}

// Stores the group + 1 of each texel's patch, 0 without a patch.
__kernel void groups_of_texels(__global const uint *texel_to_patch, __global const uint *leaders,
                               __global const uint *numbers, __global uint *groups, const uint count)
{
    const uint i = get_global_id(0);
    if (i < count)
        groups[i] = texel_to_patch[i] ? numbers[leaders[texel_to_patch[i] - 1]] : 0;
}
