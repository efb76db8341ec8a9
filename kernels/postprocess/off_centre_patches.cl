#include "texel_corners.cl"

// Marks patches whose point is farther from the centre of its texel than rounding explains, in texels
// (engine/postprocess/lightmap_points.py).
__kernel void find_thin(__global const float *uvs, __global const int *triangles, __global const float *barycentrics,
                        __global const int *texels, const int resolution, const float rounding, __global uchar *thin,
                        const int count)
{
    const int patch = get_global_id(0);
    if (patch >= count)
        return;
    float2 corners[3];
    const float2 texel = (float2)(texels[patch] % resolution, texels[patch] / resolution);
    corners_at(uvs, triangles[patch], resolution, texel, corners);
    const float3 part = vload3(patch, barycentrics);
    const float2 at = part.x * corners[0] + part.y * corners[1] + part.z * corners[2];
    thin[patch] = any(fabs(at - 0.5f) > rounding);
}
