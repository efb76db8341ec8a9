#pragma once

#include "texel_corners.cl"
#include "texel_clip.cl"

// Returns the centroid of the part of a texel that a triangle covers, as barycentrics. For an area of about 0 it is the
// mean of the fan's centroids. corner: lower left corner of the texel, texels.
float3 covered_middle(__global const float *uvs, const int triangle, const int resolution, const float2 corner)
{
    float2 corners[3];
    float4 polygon[MOST_CORNERS];
    corners_at(uvs, triangle, resolution, corner, corners);

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
    return (float3)(1.0f - part.x - part.y, part);
}
