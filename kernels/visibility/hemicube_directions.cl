#pragma once

// Directions of hemicube texels, and look-ups of the background in an equirectangular map.

// Returns the direction of a texel of an unfolded hemicube (n columns, 3n rows: top face, then four half side faces)
// along right, up and normal. Not normalised.
float3 texel_direction(const int x, const int y, const int n)
{
    const float across = (2 * x + 1) / (float)n - 1.0f;
    if (y < n)
        return (float3)(across, (2 * y + 1) / (float)n - 1.0f, 1.0f);
    const int side = (y - n) / (n / 2);
    const float height = (2 * ((y - n) % (n / 2)) + 1) / (float)n;
    const float forward = side % 2 == 0 ? 1.0f : -1.0f;
    return side < 2 ? (float3)(forward, forward * across, height) : (float3)(-forward * across, forward, height);
}

// Returns the background radiance in a world-space direction: bilinear look-up in an equirectangular map whose row 0 is
// at the bottom (Cycles, kernel/camera/projection.h).
float4 background_radiance(const float3 direction, __global const float4 *sky, const int2 size)
{
    if (size.x * size.y == 1)
        return sky[0];
    const float2 pixel = (float2)((0.5f - atan2pi(direction.y, direction.x) * 0.5f) * size.x - 0.5f,
                                  (1.0f - acospi(clamp(direction.z / length(direction), -1.0f, 1.0f))) * size.y - 0.5f);
    const float2 low = floor(pixel), f = pixel - low;
    const int x0 = ((int)low.x + size.x) % size.x, x1 = (x0 + 1) % size.x;
    const int y0 = clamp((int)low.y, 0, size.y - 1), y1 = clamp((int)low.y + 1, 0, size.y - 1);
    const float4 below = mix(sky[y0 * size.x + x0], sky[y0 * size.x + x1], f.x);
    const float4 above = mix(sky[y1 * size.x + x0], sky[y1 * size.x + x1], f.x);
    return mix(below, above, f.y);
}
