// Conversion of radiance to three half floats per patch for transfer between devices.

// Stores the maximum channel value found by each work item.
__kernel void brightest(__global const float4 *radiance, const int count, __global float *most)
{
    float found = 0.0f;
    for (int i = get_global_id(0); i < count; i += get_global_size(0))
        found = fmax(found, fmax(radiance[i].x, fmax(radiance[i].y, radiance[i].z)));
    most[get_global_id(0)] = found;
}

// Converts radiance (after one black entry) times a factor to half floats.
__kernel void to_half(__global const float4 *radiance, const float factor, __global half *parts, const int count)
{
    const int i = get_global_id(0);
    if (i < count)
        vstore_half3_rte(factor * radiance[i + 1].xyz, i, parts);
}

// Converts half floats back to radiance, with a black entry before and after.
__kernel void from_half(__global const half *parts, const float unit, __global float4 *radiance, const int count)
{
    const int i = get_global_id(0);
    if (i < count + 2)
        radiance[i] = i == 0 || i == count + 1 ? (float4)(0.0f) : (float4)(unit * vload_half3(i - 1, parts), 0.0f);
}

// Joins gathered irradiance and validity (fraction of the hemisphere without back faces) to float4.
__kernel void join_half(__global const float *light, __global const float *front, __global float4 *gathered,
                        const int count)
{
    const int i = get_global_id(0);
    if (i < count)
        gathered[i] = (float4)(vload3(i, light), front[i]);
}
