#include "texel.cl"

// Candidates for substitutes (engine/validity/substitutes.py): valid patches beside the texels of invalid ones, on the
// same plane.

// Minimum cosine between the normals of a patch and its substitute, and maximum distance between their planes, texels.
#define ALIKE 0.9f
#define NEAR 0.5f

#define PATCHES \
    __global const uint *entries, __global const uchar *invalid, __global const int *triangles, \
        __global const float *barycentrics, __global const float *corners, __global const float *geometric, \
        __global const float *longer

float3 centre_of(const uint patch, PATCHES)
{
    const float3 w = vload3(patch, barycentrics);
    const size_t corner = 3 * (size_t)triangles[patch];
    return w.x * vload3(corner, corners) + w.y * vload3(corner + 1, corners) + w.z * vload3(corner + 2, corners);
}

// Returns true if a patch lies on the plane of another one, which is `longer` wide.
bool is_on_plane(const uint patch, const uint other, PATCHES)
{
    const int triangle = triangles[patch];
    const float3 normal = vload3(triangle, geometric);
    if (!(dot(normal, vload3(triangles[other], geometric)) > ALIKE))
        return false;
    const float3 away = centre_of(other, entries, invalid, triangles, barycentrics, corners, geometric, longer)
        - centre_of(patch, entries, invalid, triangles, barycentrics, corners, geometric, longer);
    return fabs(dot(away, normal)) < NEAR * longer[triangle];
}

// Returns the number of candidates around a texel; stores their patches in `found` unless it is null.
uchar find_candidates(const int x, const int y, const size_t texel, const int width, const int height,
                      __global uint *found, PATCHES)
{
    const uint patch = entries[texel] - 1;
    uchar count = 0;
    if (!entries[texel] || !invalid[patch])
        return 0;
    for (int row = max(y - 1, 0); row <= min(y + 1, height - 1); ++row)
        for (int column = max(x - 1, 0); column <= min(x + 1, width - 1); ++column) {
            const uint other = entries[texel + (row - y) * width + column - x] - 1;
            if (other == UINT_MAX || invalid[other]
                || !is_on_plane(patch, other, entries, invalid, triangles, barycentrics, corners, geometric, longer))
                continue;
            if (found)
                found[count] = other;
            ++count;
        }
    return count;
}

__kernel void count_candidates(PATCHES, __global uchar *counts, const int width, const int height)
{
    TEXEL;
    counts[texel] = find_candidates(x, y, texel, width, height, 0, entries, invalid, triangles, barycentrics, corners,
                                    geometric, longer);
}

// Lists the candidates of some texels from firsts[i] on, and before all candidates the invalid patch of each.
__kernel void list_candidates(PATCHES, const int width, __global const uint *texels, __global const uint *firsts,
                              const uint pairs, __global uint *listed, const int count)
{
    const int i = get_global_id(0);
    if (i >= count)
        return;
    const uint texel = texels[i], first = firsts[i];
    const int found = find_candidates(texel % width, texel / width % width, texel, width, width,
                                      listed + pairs + first, entries, invalid, triangles, barycentrics, corners,
                                      geometric, longer);
    for (int k = 0; k < found; ++k)
        listed[first + k] = entries[texel] - 1;
}
