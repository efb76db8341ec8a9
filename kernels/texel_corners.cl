// Corners of a triangle, texels, from the corner of one.
void corners_at(__global const float *uvs, const int triangle, const int resolution, const int2 texel, float2 *corners)
{
    for (int k = 0; k < 3; ++k)
        corners[k] = fma(vload2(3 * triangle + k, uvs), (float2)(resolution), -convert_float2(texel));
}
