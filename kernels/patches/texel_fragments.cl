#include "texel_corners.cl"
#include "texel_clip.cl"

// Texel fragments: conservative rasterisation of lightmap UVs. Finds the parts of partly covered texels that each
// triangle covers, and places sample points in them (engine/patches/texel_fragments.py). Positions are relative to a
// texel or row, so that large lightmaps stay exact.

// Increments of the R2 sequence (Roberts 2018), as fractions of 2^32.
#define R2 (uint2)(3242174889u, 2447445414u)

// Slack for the rounding of column positions, texels (chosen).
#define ROUNDING 2e-3f

float covered_area(__global const float *uvs, const int triangle, const int resolution, const int2 texel)
{
    float2 corners[3];
    float4 polygon[MOST_CORNERS];
    corners_at(uvs, triangle, resolution, convert_float2(texel), corners);
    const int count = clip_at_texel(corners, polygon);
    float area = 0.0f;
    for (int k = 0; k + 2 < count; ++k)
        area += fan_area(polygon, k);
    return area;
}

// Returns minimum and maximum x of a triangle's outline between two heights; (INFINITY, -INFINITY) if none.
float2 extremes(const float2 *corners, const float low, const float high)
{
    float2 range = (float2)(INFINITY, -INFINITY);
    for (int k = 0; k < 3; ++k) {
        const float2 start = corners[k], end = corners[k < 2 ? k + 1 : 0];
        if (fmax(start.y, end.y) < low || fmin(start.y, end.y) > high)
            continue;
        const float rise = end.y - start.y;
        const float from = rise != 0.0f ? clamp((low - start.y) / rise, 0.0f, 1.0f) : 0.0f;
        const float to = rise != 0.0f ? clamp((high - start.y) / rise, 0.0f, 1.0f) : 1.0f;
        const float first = start.x + from * (end.x - start.x), second = start.x + to * (end.x - start.x);
        range = (float2)(fmin(range.x, fmin(first, second)), fmax(range.y, fmax(first, second)));
    }
    return range;
}

// Returns column spans of a triangle in a row of texels: it touches columns x..w and fully covers columns y..z.
int4 spans_in_row(const float2 *corners, const int resolution)
{
    const float last = resolution;
    const float2 touched = extremes(corners, 0.0f, 1.0f);
    const float2 below = extremes(corners, 0.0f, 0.0f), above = extremes(corners, 1.0f, 1.0f);
    const float start = clamp(floor(touched.x - ROUNDING), 0.0f, last);
    const float end = clamp(ceil(touched.y + ROUNDING), start, last);
    const float filled = clamp(ceil(fmax(below.x, above.x) + ROUNDING), start, end);
    const float until = clamp(floor(fmin(below.y, above.y) - ROUNDING), filled, end);
    return convert_int4((float4)(start, filled, until, end));
}

// Counts (total = 0) or lists the wanted texels of a row that a triangle touches but does not fill. When listing,
// entries go from starts[item] on, in columns of `total` words: triangle, texel, covered area.
__kernel void border_texels(__global const float *uvs, __global const int *triangles, __global const int *rows,
                            __global const int *atlases, __global const uchar *wanted, const int resolution,
                            const int total, __global int *starts, __global int *found, const int count)
{
    const int item = get_global_id(0);
    if (item >= count)
        return;
    const int triangle = triangles[item], row = rows[item];
    float2 corners[3];
    corners_at(uvs, triangle, resolution, (float2)(0.0f, row), corners);
    const int4 spans = spans_in_row(corners, resolution);
    __global const uchar *here = wanted + ((size_t)atlases[triangle] * resolution + row) * resolution;
    int number = total ? starts[item] : 0;
    for (int column = spans.x; column < spans.w; ++column) {
        if (column == spans.y)
            column = spans.z;
        if (column >= spans.w || !here[column])
            continue;
        if (total) {
            found[number] = triangle;
            found[total + number] = row * resolution + column;
            found[2 * total + number] = as_int(covered_area(uvs, triangle, resolution, (int2)(column, row)));
        }
        ++number;
    }
    if (!total)
        starts[item] = number;
}

__kernel void piece_areas(__global const float *uvs, __global const int *triangles, __global const int *texels,
                          const int resolution, __global float *areas, const int count)
{
    const int piece = get_global_id(0);
    if (piece < count)
        areas[piece] = covered_area(uvs, triangles[piece], resolution,
                                    (int2)(texels[piece] % resolution, texels[piece] / resolution));
}

// Maps a point of the unit square to the covered part of a texel, uniform in area; returns barycentrics of the second
// and third corner. unit.x selects a triangle of the fan by area and is reused within it.
float2 point_within(const float2 *corners, const float2 unit)
{
    float4 polygon[MOST_CORNERS];
    const int last = clip_at_texel(corners, polygon) - 3;
    float left = 0.0f;
    for (int k = 0; k <= last; ++k)
        left += fan_area(polygon, k);
    left *= unit.x;
    int fan = 0;
    for (; fan < last && left >= fan_area(polygon, fan); ++fan)
        left -= fan_area(polygon, fan);
    const float root = sqrt(clamp(left / fmax(fan_area(polygon, fan), 1e-30f), 0.0f, 1.0f)), across = unit.y;
    return last < 0 ? (float2)(1.0f / 3.0f)
                    : (1.0f - root) * polygon[0].zw + root * (1.0f - across) * polygon[fan + 1].zw
            + root * across * polygon[fan + 2].zw;
}

// Tolerance at which a grid point counts as on a triangle, texels. Both triangles of a shared edge include it.
#define RIM 1e-4f

// Minimum fraction of grid points on triangles for a texel to use the regular grid (chosen).
#define GRID_FROM 0.75f

// Returns a.x b.y - a.y b.x with full precision under cancellation (Kahan's difference of products).
float cross2(const float2 a, const float2 b)
{
    const float product = a.y * b.x, off = fma(-a.y, b.x, product);
    return fma(a.x, b.y, -product) + off;
}

// Returns true if a position lies on a triangle, within RIM of its sides. part: barycentrics, clamped to the triangle.
bool is_on(const float2 *corners, const float2 place, float3 *part)
{
    const float2 second = corners[1] - corners[0], third = corners[2] - corners[0], here = place - corners[0];
    const float area = cross2(second, third), v = cross2(here, third) / area, w = cross2(second, here) / area;
    const float3 all_parts = (float3)(1.0f - v - w, v, w), on_triangle = clamp(all_parts, 0.0f, 1.0f);
    const float3 sides = (float3)(distance(second, third), length(third), length(second));
    *part = on_triangle / (on_triangle.x + on_triangle.y + on_triangle.z);
    return all(all_parts * fabs(area) >= -RIM * sides);
}

// Places side x side sample points in each texel. Fragments are sorted by texel; texel i has fragments starts[i] to
// starts[i + 1].
// If triangles cover most of the texel, the points form a regular grid. Each lies on the first fragment that contains
// it, or has piece -1.
// Otherwise all points lie in the covered part: systematic sampling by area allots them to fragments, and an R2
// sequence places them in each.
// weights: weight of each point of a texel, as a fraction of the texel's area. counts: number of points of each texel.
__kernel void points_in_texels(__global const float *uvs, __global const int *triangles, __global const int *texels,
                               __global const float *areas, __global const int *starts, const int resolution,
                               const int side, __global int *pieces, __global float *barycentrics,
                               __global float *positions, __global float *weights, __global int *counts,
                               const int count)
{
    const int i = get_global_id(0);
    if (i >= count)
        return;
    const int points = side * side, at = texels[starts[i]];
    const float2 origin = (float2)(at % resolution, at / resolution);
    float2 corners[3];
    int found = 0;
    for (int point = 0; point < points; ++point) {
        const float2 place = ((float2)(point % side, point / side) + 0.5f) / side;
        const int item = i * points + point;
        pieces[item] = -1;
        for (int piece = starts[i]; piece < starts[i + 1]; ++piece) {
            float3 part;
            corners_at(uvs, triangles[piece], resolution, origin, corners);
            if (!is_on(corners, place, &part))
                continue;
            pieces[item] = piece;
            vstore3(part, item, barycentrics);
            vstore2(origin + place, item, positions);
            ++found;
            break;
        }
    }
    weights[i] = 1.0f / points;
    counts[i] = found;
    if (found >= GRID_FROM * points)
        return;

    // Take the points inside the covered part, for charts smaller than a texel and corners of large charts.
    float covered = 0.0f;
    for (int piece = starts[i]; piece < starts[i + 1]; ++piece)
        covered += areas[piece];
    weights[i] = covered / points;
    counts[i] = points;
    int piece = starts[i];
    float passed = areas[piece];
    for (int point = 0; point < points; ++point) {
        while (piece + 1 < starts[i + 1] && passed <= (point + 0.5f) / points * covered)
            passed += areas[++piece];
        const int item = i * points + point;
        const uint2 steps = (uint2)(1u << 31) + (uint)(item + 1) * R2;
        corners_at(uvs, triangles[piece], resolution, origin, corners);
        const float2 part = point_within(corners, convert_float2(steps >> 8) / 16777216.0f);
        const float3 all_parts = clamp((float3)(1.0f - part.x - part.y, part), 0.0f, 1.0f);
        pieces[item] = piece;
        vstore3(all_parts, item, barycentrics);
        vstore2(origin + all_parts.x * corners[0] + all_parts.y * corners[1] + all_parts.z * corners[2], item,
                positions);
    }
}

// Compacts the points found by `points_in_texels`: points of texel i are stored from firsts[i] on.
__kernel void list_points(__global const int *triangles, __global const int *texels, __global const int *pieces,
                          __global const float *barycentrics, __global const float *positions,
                          __global const float *weights, __global const int *firsts, const int points,
                          __global int *listed_triangles, __global int *listed_texels,
                          __global float *listed_barycentrics, __global float *listed_positions,
                          __global float *listed_weights, const int count)
{
    const int i = get_global_id(0);
    if (i >= count)
        return;
    int place = firsts[i];
    for (int item = i * points; item < (i + 1) * points; ++item) {
        const int piece = pieces[item];
        if (piece < 0)
            continue;
        listed_triangles[place] = triangles[piece];
        listed_texels[place] = texels[piece];
        vstore3(vload3(item, barycentrics), place, listed_barycentrics);
        vstore2(vload2(item, positions), place, listed_positions);
        listed_weights[place] = weights[i];
        ++place;
    }
}
