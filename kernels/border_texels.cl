// Texels that a triangle touches without covering their centres: whose patch they show, and the middle of what
// the triangle covers of them. WITHIN: see engine/patches/border_texels.py.

// The corners of a triangle in texels from a point that float32 holds.
void corners_from(const float2 point, __global const float2 *uvs, const int triangle, const float resolution,
                  float2 *corners)
{
    for (int i = 0; i < 3; ++i)
        corners[i] = fma(uvs[3 * triangle + i], (float2)(resolution), -point);
}

// The point of a triangle's border that is nearest to 0, as barycentrics; inside: it lies within the texel about 0.
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
                    : i == 1 ? (float3)(0.0f, 1.0f - t, t) : (float3)(t, 0.0f, 1.0f - t);
        }
    }
    return nearest;
}

float3 in_world(__global const float *positions, const int triangle, const float3 weights)
{
    return weights.x * vload3(3 * triangle, positions) + weights.y * vload3(3 * triangle + 1, positions) +
           weights.z * vload3(3 * triangle + 2, positions);
}

// nearest: the nearest patch of the same surface + 1, or 0, of each border texel. Same surface: the same mesh, and
// at most twice as far away in the world as on the lightmap. inside: the triangle comes so near to the texel's
// centre that what it shows is more than a border. texels: of all atlases; sizes: metres of a texel of each
// triangle, along the longer side; offsets: neighbours, nearest first.
__kernel void nearest_patches(__global const long *texels, __global const int *triangles,
                              __global const float2 *uvs, __global const float *positions,
                              __global const int *meshes, __global const float *sizes,
                              __global const int2 *offsets, const int neighbours, const int resolution,
                              __global const uint *texel_to_patch, __global const int *patch_triangles,
                              __global const float *barycentrics, __global uint *nearest,
                              __global uchar *inside, const int count)
{
    const int i = get_global_id(0);
    if (i >= count)
        return;
    const long texel = texels[i];
    const int x = texel % resolution, y = texel / resolution % resolution, triangle = triangles[i];
    float2 corners[3];
    corners_from((float2)(x + 0.5f, y + 0.5f), uvs, triangle, resolution, corners);
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

typedef struct {
    float2 at;       // in the texel
    float3 weights;  // barycentrics
} Corner;

// Corners of a triangle clipped at the four sides of a texel.
#define CORNERS 7

float inner_distance(const Corner corner, const int side)
{
    const float along = side < 2 ? corner.at.x : corner.at.y;
    return side % 2 == 0 ? along : 1.0f - along;
}

// Clips a convex polygon at a side of the texel (Sutherland and Hodgman 1974); returns its corners, 1 at least.
int clip_at_side(Corner *corners, const int count, const int side)
{
    Corner kept[CORNERS];
    int left = 0;
    for (int i = 0; i < count; ++i) {
        const Corner here = corners[i], next = corners[(i + 1) % count];
        const float before = inner_distance(here, side), after = inner_distance(next, side);
        if (before >= 0.0f && left <= count)
            kept[left++] = here;
        if ((before >= 0.0f) != (after >= 0.0f) && left <= count) {
            const float t = before / (before - after);
            kept[left].at = here.at + t * (next.at - here.at);
            kept[left++].weights = here.weights + t * (next.weights - here.weights);
        }
    }
    for (int i = 0; i < left; ++i)
        corners[i] = kept[i];
    return max(left, 1);
}

// The centroids, as barycentrics, of what triangles cover of texels; without an area a point between the corners.
__kernel void covered_middles(__global const long *texels, __global const int *triangles,
                              __global const float2 *uvs, const int resolution, __global float *middles,
                              const int count)
{
    const int i = get_global_id(0);
    if (i >= count)
        return;
    float2 at[3];
    const long texel = texels[i];
    corners_from((float2)(texel % resolution, texel / resolution % resolution), uvs, triangles[i], resolution, at);
    Corner corners[CORNERS] = {
        {at[0], (float3)(1.0f, 0.0f, 0.0f)}, {at[1], (float3)(0.0f, 1.0f, 0.0f)}, {at[2], (float3)(0.0f, 0.0f, 1.0f)},
    };
    int left = 3;
    for (int side = 0; side < 4; ++side)
        left = clip_at_side(corners, left, side);

    // A fan of triangles from the first corner; corners that are not there repeat it.
    for (int k = left; k < CORNERS; ++k)
        corners[k] = corners[0];
    float total = 0.0f;
    float3 weighted = 0.0f, plain = 0.0f;
    for (int k = 1; k + 1 < CORNERS; ++k) {
        const float2 first = corners[k].at - corners[0].at, second = corners[k + 1].at - corners[0].at;
        const float area = fabs(first.x * second.y - first.y * second.x) / 2.0f;
        const float3 middle = (corners[0].weights + corners[k].weights + corners[k + 1].weights) / 3.0f;
        total += area;
        weighted += area * middle;
        plain += middle;
    }
    const float3 centroid = total < 5e-10f ? plain : weighted;
    vstore3(centroid / (centroid.x + centroid.y + centroid.z), i, middles);
}
