#pragma once

// What a triangle covers of a texel: a polygon, and the areas of its fan of triangles around its first corner.

#define MOST_CORNERS 7  // of a triangle that is clipped at four lines

float distance_to(const float4 corner, const int line)
{
    const float along = line & 1 ? corner.y : corner.x;
    return line & 2 ? 1.0f - along : along;
}

// Clips a triangle at the four sides of a texel (Sutherland and Hodgman 1974). xy: position in the texel; zw:
// barycentrics of the second and the third corner. Returns the number of corners, 1 at least: where nothing is left,
// the first is one of the triangle before its last cut. A function and loops of their own: repeated in line they take
// drivers seconds to build.
__attribute__((noinline))
int clip_at_texel(const float2 *corners, float4 *polygon)
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

// Area of a triangle of a polygon's fan around its first corner.
float fan_area(const float4 *polygon, const int k)
{
    const float2 first = polygon[k + 1].xy - polygon[0].xy, second = polygon[k + 2].xy - polygon[0].xy;
    return 0.5f * fabs(first.x * second.y - first.y * second.x);
}
