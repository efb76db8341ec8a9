#pragma once

// Corners of a triangle, texels, from a point, which float32 holds exactly.
void corners_at(__global const float *uvs, const int triangle, const int resolution, const float2 point,
                float2 *corners)
{
    for (int k = 0; k < 3; ++k)
        corners[k] = fma(vload2(3 * triangle + k, uvs), (float2)(resolution), -point);
}
