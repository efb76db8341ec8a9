#define STEPS_2D (uint2)(3242174889u, 2447445414u)  // of the R2 sequence (engine/visibility/views/directions.py)

// Luminance of back faces, for the validity test (engine/validity/lit_backs.py).

// Number of sample points per triangle.
#define POINTS 64

// Stores the mean luminance of the back face of each triangle, from an R2 point set; 0 for triangles whose back face
// has no patches. backs: twin triangle of each triangle's back face, or -1.
__kernel void luminance_of_backs(__global const float2 *uvs, __global const int *atlases,
                                 __global const uint *texel_to_patch, const int resolution, __global const int *backs,
                                 __global const float4 *radiance, __global float *luminances, const int count)
{
    const int triangle = get_global_id(0);
    if (triangle >= count)
        return;
    float sum = 0.0f;
    const int back = backs[triangle];
    for (int i = 0; back >= 0 && i < POINTS; ++i) {
        float2 w = convert_float2(((uint)i * STEPS_2D) >> 8) * (1.0f / 16777216.0f);
        w = w.x + w.y > 1.0f ? 1.0f - w : w;
        __global const float2 *corner = uvs + 3 * (size_t)back;
        const float2 uv = corner[0] * (1.0f - w.x - w.y) + corner[1] * w.x + corner[2] * w.y;
        const int2 texel = clamp(convert_int2(uv * resolution), 0, resolution - 1);
        const size_t row = (size_t)atlases[back] * resolution + texel.y;
        const float4 light = radiance[texel_to_patch[row * resolution + texel.x]];
        sum += 0.2126f * light.x + 0.7152f * light.y + 0.0722f * light.z;
    }
    luminances[triangle] = sum / POINTS;
}

// Extracts the radiance of every `stride`-th patch.
__kernel void sample_radiance(__global const float4 *radiance, const int stride, __global float4 *sampled,
                              const int count)
{
    const int i = get_global_id(0);
    if (i < count)
        sampled[i] = radiance[(size_t)i * stride + 1];
}
