// Converts E/pi and its L1 (irradiance_l1.cl) of patches to directional lightmaps. Formulas:
// engine/postprocess/directional_maps.py.

// Returns L1 of a patch along a world axis: sampled direct light (one plane per axis) plus gathered light.
#define GIVEN \
    __global const float *light, const int stride, __global const float *sampled, __global const float4 *gathered
float3 l1_along(__global const float *sampled, __global const float4 *gathered, const int axis, const size_t patch,
                const int count)
{
    return vload3((size_t)axis * count + patch, sampled) + gathered[3 * patch + axis].xyz;
}

float luminance(const float3 rgb) { return 0.2126f * rgb.x + 0.7152f * rgb.y + 0.0722f * rgb.z; }

__kernel void tilted_maps(GIVEN, __global const ReceiverRecord *receivers, __global float *l0, __global float *l1_x,
                          __global float *l1_y, __global float *l1_z, const int count)
{
    const size_t i = get_global_id(0);
    if (i >= count)
        return;
    const float3 normal = vload3(0, receivers[i].normal);
    const float3 x = l1_along(sampled, gathered, 0, i, count), y = l1_along(sampled, gathered, 1, i, count),
                 z = l1_along(sampled, gathered, 2, i, count);
    vstore3(vload3(0, light + i * stride) - normal.x * x - normal.y * y - normal.z * z, i, l0);
    vstore3(x, i, l1_x);
    vstore3(y, i, l1_y);
    vstore3(z, i, l1_z);
}

__kernel void dominant_direction(GIVEN, __global float *direction, const int count)
{
    const size_t i = get_global_id(0);
    if (i >= count)
        return;
    const float all = luminance(vload3(0, light + i * stride));
    const float3 along = (float3)(luminance(l1_along(sampled, gathered, 0, i, count)),
                                  luminance(l1_along(sampled, gathered, 1, i, count)),
                                  luminance(l1_along(sampled, gathered, 2, i, count)));
    vstore3(all > 0.0f ? along / all : (float3)(0.0f), i, direction);
}

// Returns across / mean per channel; 0 where the mean is 0.
float3 part_of(const float3 across, const float3 mean)
{
    return (float3)(mean.x > 0.0f ? across.x / mean.x : 0.0f, mean.y > 0.0f ? across.y / mean.y : 0.0f,
                    mean.z > 0.0f ? across.z / mean.z : 0.0f);
}

__kernel void projected_maps(GIVEN, __global const ReceiverRecord *receivers, __global float *l0, __global float *l1_x,
                             __global float *l1_y, __global float *l1_z, const int count)
{
    const size_t i = get_global_id(0);
    if (i >= count)
        return;
    const float3 normal = vload3(0, receivers[i].normal);
    const float3 x = l1_along(sampled, gathered, 0, i, count), y = l1_along(sampled, gathered, 1, i, count),
                 z = l1_along(sampled, gathered, 2, i, count);
    const float3 mean = normal.x * x + normal.y * y + normal.z * z;
    const float3 across = 0.5f * vload3(0, light + i * stride) - mean;
    const float3 along_x = part_of(0.5f * (x + normal.x * across), mean),
                 along_y = part_of(0.5f * (y + normal.y * across), mean),
                 along_z = part_of(0.5f * (z + normal.z * across), mean);
    const float3 longest = fmax(sqrt(along_x * along_x + along_y * along_y + along_z * along_z), 1.0f);
    vstore3(mean, i, l0);
    vstore3(along_x / longest, i, l1_x);
    vstore3(along_y / longest, i, l1_y);
    vstore3(along_z / longest, i, l1_z);
}
