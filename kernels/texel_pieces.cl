// What triangles cover of texels that they do not fill: conservative rasterisation of lightmap UVs, and points within
// (engine/patches/texel_pieces.py). Positions are relative to a texel or row, so that large lightmaps stay exact.

// Multipliers of the R2 sequence (Roberts 2018), in parts of 2^32.
#define R2 (uint2)(3242174889u, 2447445414u)

// Rounding of a column's position, texels: spans of borders are wider by as much.
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

// The least and the greatest x that a triangle's border has between two heights; (INFINITY, -INFINITY) for none.
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

// Columns of a row of texels: a triangle touches those from x to w, and fills those from y to z.
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

// Wanted texels of a row that a triangle touches and does not fill: how many, and from `starts` on, which.
__kernel void border_texels(__global const float *uvs, __global const int *triangles, __global const int *rows,
                            __global const int *atlases, __global const uchar *wanted, const int resolution,
                            const int lists, __global int *starts, __global int *found, __global int *found_texels,
                            __global float *areas, const int count)
{
    const int item = get_global_id(0);
    if (item >= count)
        return;
    const int triangle = triangles[item], row = rows[item];
    float2 corners[3];
    corners_at(uvs, triangle, resolution, (float2)(0.0f, row), corners);
    const int4 spans = spans_in_row(corners, resolution);
    __global const uchar *here = wanted + ((size_t)atlases[triangle] * resolution + row) * resolution;
    int number = lists ? starts[item] : 0;
    for (int column = spans.x; column < spans.w; ++column) {
        if (column == spans.y)
            column = spans.z;
        if (column >= spans.w || !here[column])
            continue;
        if (lists) {
            found[number] = triangle;
            found_texels[number] = row * resolution + column;
            areas[number] = covered_area(uvs, triangle, resolution, (int2)(column, row));
        }
        ++number;
    }
    if (!lists)
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

// Points of pieces, as barycentrics, by an R2 sequence: one coordinate chooses a triangle of the piece's fan by area,
// and what is left of it, with the other, a point in there.
__kernel void points_within(__global const float *uvs, __global const int *triangles, __global const int *texels,
                            __global const int *pieces, const int resolution, __global float *barycentrics,
                            const int count)
{
    const int point = get_global_id(0);
    if (point >= count)
        return;
    const uint2 steps = (uint2)(1u << 31) + (uint)(point + 1) * R2;
    const float2 unit = convert_float2(steps >> 8) / 16777216.0f;
    const int piece = pieces[point], triangle = triangles[piece];
    const int2 texel = (int2)(texels[piece] % resolution, texels[piece] / resolution);
    float2 corners[3];
    float4 polygon[MOST_CORNERS];
    corners_at(uvs, triangle, resolution, convert_float2(texel), corners);
    const int last = clip_at_texel(corners, polygon) - 3;
    float left = 0.0f;
    for (int k = 0; k <= last; ++k)
        left += fan_area(polygon, k);
    left *= unit.x;
    int fan = 0;
    for (; fan < last && left >= fan_area(polygon, fan); ++fan)
        left -= fan_area(polygon, fan);
    const float root = sqrt(clamp(left / fmax(fan_area(polygon, fan), 1e-30f), 0.0f, 1.0f)), across = unit.y;
    const float2 part = last < 0 ? (float2)(1.0f / 3.0f)
        : (1.0f - root) * polygon[0].zw + root * (1.0f - across) * polygon[fan + 1].zw
            + root * across * polygon[fan + 2].zw;
    const float3 all = (float3)(1.0f - part.x - part.y, part);
    vstore3(clamp(all, 0.0f, 1.0f), point, barycentrics);
}
