#include "covered_middle.cl"
#include "texel_corners.cl"

// Insets patches that lie on the outline of a chart; the host version is engine/patches/edge_patch_points.py.

#define ON_EDGE 0.02f  // maximum distance from an edge, texels
#define LEADING 0.3f   // minimum component of the outward normal that points to a neighbour

// Moves patches on an edge of their triangle, with no patch in the texels beyond, to the centroid of the covered part of
// their texel. own: patch + 1 of each texel of all lightmaps, or 0.
__kernel void inset_edge_patches(__global const float *uvs, __global const uint *own,
                                 __global const int *patch_triangles, __global float *barycentrics,
                                 const int resolution, const int count)
{
    const int texel = get_global_id(0);
    if (texel >= count || own[texel] == 0)
        return;
    const int x = texel % resolution, y = texel / resolution % resolution, patch = own[texel] - 1;
    const bool left = x > 0 && own[texel - 1] > 0, right = x < resolution - 1 && own[texel + 1] > 0;
    const bool below = y > 0 && own[texel - resolution] > 0, above = y < resolution - 1 && own[texel + resolution] > 0;
    if (left && right && below && above)
        return;

    // Edge k is opposite corner k.
    float2 corners[3];
    const int triangle = patch_triangles[patch];
    bool is_on_edge = false;
    corners_at(uvs, triangle, resolution, (float2)(x + 0.5f, y + 0.5f), corners);
    float parts[3];
    vstore3(vload3(patch, barycentrics), 0, parts);
    for (int k = 0; k < 3; ++k) {
        const float2 start = corners[(k + 1) % 3], along = corners[(k + 2) % 3] - start;
        const float2 normal = (float2)(along.y, -along.x) / fmax(length(along), 1e-30f);
        const float height = dot(start - corners[k], normal);
        const float2 outward = height < 0.0f ? -normal : normal;
        const bool goes_on = (outward.x > LEADING && right) || (outward.x < -LEADING && left)
            || (outward.y > LEADING && above) || (outward.y < -LEADING && below);
        is_on_edge |= parts[k] * fabs(height) < ON_EDGE && !goes_on;
    }
    if (is_on_edge)
        vstore3(covered_middle(uvs, triangle, resolution, (float2)(x, y)), patch, barycentrics);
}
