#include "covered_middle.cl"
#include "texel_corners.cl"

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
// inside: 1 if the triangle passes within WITHIN of the texel's centre. thin: 1 if it does so and there is no patch.
// texels: flat indices over all lightmaps. sizes: texel size of each triangle along the longer side, metres. offsets:
//     neighbour offsets, nearest first.
__kernel void nearest_patches(__global const int *texels, __global const int *triangles, __global const float *uvs,
                              __global const float *positions, __global const int *meshes, __global const float *sizes,
                              __global const int2 *offsets, const int neighbours, const int resolution,
                              __global const uint *texel_to_patch, __global const int *patch_triangles,
                              __global const float *barycentrics, __global uint *nearest, __global uint *inside,
                              __global uint *thin, const int count)
{
    const int i = get_global_id(0);
    if (i >= count)
        return;
    const int texel = texels[i];
    const int x = texel % resolution, y = texel / resolution % resolution, triangle = triangles[i];
    float2 corners[3];
    corners_at(uvs, triangle, resolution, (float2)(x + 0.5f, y + 0.5f), corners);
    bool within = false;
    const float3 point = in_world(positions, triangle, nearest_point(corners, &within));
    inside[i] = within;
    nearest[i] = 0;
    thin[i] = 0;
    for (int k = 0; k < neighbours; ++k) {
        const int2 offset = offsets[k];
        if (x + offset.x < 0 || x + offset.x >= resolution || y + offset.y < 0 || y + offset.y >= resolution)
            continue;
        const uint number = texel_to_patch[texel + offset.y * resolution + offset.x];
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
    thin[i] = within;
}

// Prepares patches for border texels that `chosen` lists. texels, triangles: of all border texels. patch_texels: texels
// of all patches, ascending in each atlas. firsts: first patch of each atlas, and their number.
// places: texel of each new patch in its atlas. rows: its row among all patches. middles: barycentrics.
// counts: number of patches on each triangle.
__kernel void thin_patches(__global const int *texels, __global const int *triangles, __global const int *chosen,
                           __global const float *uvs, const int resolution, __global const int *patch_texels,
                           __global const int *firsts, __global int *keys, __global int *places, __global int *owners,
                           __global float *middles, __global int *rows, __global int *counts, const int count)
{
    const int i = get_global_id(0);
    if (i >= count)
        return;
    const int key = texels[chosen[i]], triangle = triangles[chosen[i]], area = resolution * resolution;
    const int atlas = key / area, place = key % area;
    int first = firsts[atlas], last = firsts[atlas + 1];
    while (first < last) {
        const int middle = first + (last - first) / 2;
        if (patch_texels[middle] < place)
            first = middle + 1;
        else
            last = middle;
    }
    keys[i] = key;
    places[i] = place;
    owners[i] = triangle;
    rows[i] = first + i;
    const float2 corner = (float2)(place % resolution, place / resolution);
    vstore3(covered_middle(uvs, triangle, resolution, corner), i, middles);
    atomic_inc(counts + triangle);
}

// Renumbers the patches of all texels after patches have been inserted. keys: texels of the new patches, ascending, and
// rows: their numbers.
__kernel void insert_patches(__global const uint *own, __global const int *keys, __global const int *rows,
                             const int inserted, __global uint *renumbered, const int count)
{
    const int texel = get_global_id(0);
    if (texel >= count)
        return;
    int first = 0, last = inserted;
    while (first < last) {
        const int middle = first + (last - first) / 2;
        if (keys[middle] < texel)
            first = middle + 1;
        else
            last = middle;
    }
    const bool is_new = first < inserted && keys[first] == texel;
    renumbered[texel] = is_new ? rows[first] + 1 : own[texel] ? own[texel] + first : 0;
}

// Stores the nearest patch + 1 of each border texel that has no patch.
__kernel void fill_border(__global const int *texels, __global const uint *nearest, __global uint *texel_to_patch,
                          const int count)
{
    const int i = get_global_id(0);
    if (i < count && texel_to_patch[texels[i]] == 0)
        texel_to_patch[texels[i]] = nearest[i];
}


