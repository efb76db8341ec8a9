#pragma once

// Computes the corners of a triangle on the lightmap relative to a point, texels. fma keeps float32 exact on large
// lightmaps.
void corners_at(__global const float *uvs, const int triangle, const int resolution, const float2 point,
                float2 *corners)
{
    for (int k = 0; k < 3; ++k)
        corners[k] = fma(vload2(3 * triangle + k, uvs), (float2)(resolution), -point);
}
