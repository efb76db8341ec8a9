// Records of patches (receiver.cl) from their triangles and barycentrics.

// corners and normals hold 9 floats a triangle, steps 10: of a texel along u and v, geometric normal, area.
// Heights of the eye as in engine/visibility/views/viewpoints.py: `heights` holds the fraction of a texel's width, the
// most, and the fraction of the largest coordinate; positions are relative to origin.
__kernel void pack(__global const int *triangles, __global const float *barycentrics,
                   __global const float *corners, __global const float *normals, __global const float *steps,
                   const float4 heights, const float4 origin, __global float4 *records, const int count)
{
    const int patch = get_global_id(0);
    if (patch >= count)
        return;
    const int triangle = triangles[patch];
    const float3 w = vload3(patch, barycentrics);
    float3 corner[3], normal[3];
    for (int i = 0; i < 3; ++i) {
        corner[i] = vload3(3 * triangle + i, corners);
        normal[i] = vload3(3 * triangle + i, normals);
    }
    __global const float *step = steps + 10 * triangle;
    const float3 geometric = vload3(2, step);
    const float3 at = w.x * corner[0] + w.y * corner[1] + w.z * corner[2];
    const float3 mean = w.x * normal[0] + w.y * normal[1] + w.z * normal[2];
    const float size = length(mean);
    const float3 shading = size > 1e-20f ? mean / size : geometric;
    const float3 place = fmax(fabs(at), fabs(at + origin.xyz));
    const float coordinate = fmax(place.x, fmax(place.y, place.z));
    const float height = fmax(fmin(heights.x * sqrt(step[9]), heights.y), heights.z * coordinate);
    __global float4 *record = records + RECEIVER * patch;
    record[0] = (float4)(at, height);
    record[1] = (float4)(shading, 0.0f);
    record[2] = (float4)(geometric, corner[0].z);
    record[3] = (float4)(vload3(0, step), corner[0].x);
    record[4] = (float4)(vload3(1, step), corner[0].y);
    record[5] = (float4)(corner[1] - corner[0], normal[0].x);
    record[6] = (float4)(corner[2] - corner[0], normal[0].y);
    record[7] = (float4)(normal[1], normal[0].z);
    record[8] = (float4)(normal[2], 0.0f);
}
