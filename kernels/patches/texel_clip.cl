#pragma once

// Clipping of a triangle to a texel. The result is a convex polygon, with fan areas around its first corner.

#define MOST_CORNERS 7  // of a triangle clipped to four lines

float distance_to(const float4 corner, const int line)
{
    const float along = line & 1 ? corner.y : corner.x;
    return line & 2 ? 1.0f - along : along;
}

// Clips a triangle to the unit square of a texel (Sutherland and Hodgman 1974). Polygon xy: position in the texel; zw:
// barycentrics of the second and third corner. Returns the number of corners, at least 1: for an empty result the first
// corner is from before the last cut. Not inlined or unrolled, because that takes drivers seconds to compile.
__attribute__((noinline)) int clip_at_texel(const float2 *corners, float4 *polygon)
{
    float4 before[MOST_CORNERS];
    int count = 3;
    polygon[0] = (float4)(corners[0], 0.0f, 0.0f);
    polygon[1] = (float4)(corners[1], 1.0f, 0.0f);
    polygon[2] = (float4)(corners[2], 0.0f, 1.0f);
#pragma unroll 1
    for (int line = 0; line < 4; ++line) {
        const int corners_before = count;
        for (int k = 0; k < corners_before; ++k)
            before[k] = polygon[k];
        count = 0;
#pragma unroll 1
        for (int k = 0; k < corners_before; ++k) {
            const float4 start = before[k], end = before[k + 1 < corners_before ? k + 1 : 0];
            const float at_start = distance_to(start, line), at_end = distance_to(end, line);
            if (at_start >= 0.0f && count < MOST_CORNERS)
                polygon[count++] = start;
            if ((at_start >= 0.0f) != (at_end >= 0.0f) && count < MOST_CORNERS)
                polygon[count++] = start + at_start / (at_start - at_end) * (end - start);
        }
    }
    return max(count, 1);
}

// Returns the area of triangle k of a polygon's fan around its first corner.
float fan_area(const float4 *polygon, const int k)
{
    const float2 first = polygon[k + 1].xy - polygon[0].xy, second = polygon[k + 2].xy - polygon[0].xy;
    return 0.5f * fabs(first.x * second.y - first.y * second.x);
}
