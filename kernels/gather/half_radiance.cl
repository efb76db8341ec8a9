// Light on its way between devices: three half floats a patch, in parts of a unit.

// The largest number of the values that each work item has seen.
__kernel void brightest(__global const float4 *radiance, const int count, __global float *most)
{
    float found = 0.0f;
    for (int i = get_global_id(0); i < count; i += get_global_size(0))
        found = fmax(found, fmax(radiance[i].x, fmax(radiance[i].y, radiance[i].z)));
    most[get_global_id(0)] = found;
}

// Radiance of patches, after one black entry, times a factor becomes half floats.
__kernel void to_half(__global const float4 *radiance, const float factor, __global half *parts, const int count)
{
    const int i = get_global_id(0);
    if (i < count)
        vstore_half3_rte(factor * radiance[i + 1].xyz, i, parts);
}

// And back, between two black entries.
__kernel void from_half(__global const half *parts, const float unit, __global float4 *radiance, const int count)
{
    const int i = get_global_id(0);
    if (i < count + 2)
        radiance[i] = i == 0 || i == count + 1 ? (float4)(0.0f) : (float4)(unit * vload_half3(i - 1, parts), 0.0f);
}

// Light that was gathered, and the fraction of each view that no back takes, become float4.
__kernel void join_half(__global const float *light, __global const float *front, __global float4 *gathered,
                        const int count)
{
    const int i = get_global_id(0);
    if (i < count)
        gathered[i] = (float4)(vload3(i, light), front[i]);
}
