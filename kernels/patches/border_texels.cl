#include "texel_corners.cl"
#include "texel_clip.cl"

// Border texels: texels that a triangle touches without covering their centre. Finds the patch that each of them
// displays, and the centroid of the covered area. WITHIN: see engine/patches/border_texels.py.

// Returns the point of a triangle's outline nearest to the origin, as barycentrics. corners: relative to the texel's
// centre, texels. inside: true if the point lies within the texel.
float3 nearest_point(const float2 *corners, bool *inside)
{
    float3 nearest = 0.0f;
    float shortest = INFINITY;
    for (int i = 0; i < 3; ++i) {
        const float2 start = corners[i], edge = corners[(i + 1) % 3] - start;
        const float t = clamp(-dot(start, edge) / fmax(dot(edge, edge), 1e-20f), 0.0f, 1.0f);
        const float2 offset = start + t * edge;
        if (length(offset) < shortest) {
            shortest = length(offset);
            *inside = fmax(fabs(offset.x), fabs(offset.y)) < WITHIN;
            nearest = i == 0 ? (float3)(1.0f - t, t, 0.0f)
                : i == 1     ? (float3)(0.0f, 1.0f - t, t)
                             : (float3)(t, 0.0f, 1.0f - t);
        }
    }
    return nearest;
}

float3 in_world(__global const float *positions, const int triangle, const float3 weights)
{
    return weights.x * vload3(3 * triangle, positions) + weights.y * vload3(3 * triangle + 1, positions)
        + weights.z * vload3(3 * triangle + 2, positions);
}

// Finds the nearest patch (+ 1, or 0) on the same surface for each border texel. Same surface: same mesh, and a world
// distance of at most twice the distance on the lightmap.
// inside: 1 if the triangle passes within WITHIN of the texel's centre.
// texels: flat indices over all lightmaps. sizes: texel size of each triangle along the longer side, metres. offsets:
//     neighbour offsets, nearest first.
__kernel void nearest_patches(__global const long *texels, __global const int *triangles, __global const float *uvs,
                              __global const float *positions, __global const int *meshes, __global const float *sizes,
                              __global const int2 *offsets, const int neighbours, const int resolution,
                              __global const uint *texel_to_patch, __global const int *patch_triangles,
                              __global const float *barycentrics, __global uint *nearest, __global uchar *inside,
                              const int count)
{
    const int i = get_global_id(0);
    if (i >= count)
        return;
    const long texel = texels[i];
    const int x = texel % resolution, y = texel / resolution % resolution, triangle = triangles[i];
    float2 corners[3];
    corners_at(uvs, triangle, resolution, (float2)(x + 0.5f, y + 0.5f), corners);
    bool within = false;
    const float3 point = in_world(positions, triangle, nearest_point(corners, &within));
    inside[i] = within;
    nearest[i] = 0;
    for (int k = 0; k < neighbours; ++k) {
        const int2 offset = offsets[k];
        if (x + offset.x < 0 || x + offset.x >= resolution || y + offset.y < 0 || y + offset.y >= resolution)
            continue;
        const uint number = texel_to_patch[texel + (long)offset.y * resolution + offset.x];
        if (number == 0)
            continue;
        const int other = patch_triangles[number - 1];
        const float3 at = in_world(positions, other, vload3(number - 1, barycentrics));
        const float reach = 2.0f * sizes[other] * length(convert_float2(offset));
        if (meshes[other] == meshes[triangle] && distance(at, point) <= reach) {
            nearest[i] = number;
            return;
        }
    }
}

// Stores the centroid of the covered part of each texel, as barycentrics of its triangle. For areas of about 0 it
// stores the mean of the fan's centroids.
__kernel void covered_middles(__global const long *texels, __global const int *triangles, __global const float *uvs,
                              const int resolution, __global float *middles, const int count)
{
    const int i = get_global_id(0);
    if (i >= count)
        return;
    float2 corners[3];
    float4 polygon[MOST_CORNERS];
    const long texel = texels[i];
    const float2 start = (float2)(texel % resolution, texel / resolution % resolution);
    corners_at(uvs, triangles[i], resolution, start, corners);

    // Unused corners repeat the first one, which adds no area.
    for (int k = clip_at_texel(corners, polygon); k < MOST_CORNERS; ++k)
        polygon[k] = polygon[0];
    float total = 0.0f;
    float2 weighted = 0.0f, plain = 0.0f;
    for (int k = 0; k + 2 < MOST_CORNERS; ++k) {
        const float area = fan_area(polygon, k);
        const float2 middle = (polygon[0].zw + polygon[k + 1].zw + polygon[k + 2].zw) / 3.0f;
        total += area;
        weighted += area * middle;
        plain += middle / (MOST_CORNERS - 2);
    }
    const float2 part = total < 5e-10f ? plain : weighted / total;
    vstore3((float3)(1.0f - part.x - part.y, part), i, middles);
}
