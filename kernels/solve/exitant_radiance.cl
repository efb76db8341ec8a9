// Computes the exitant radiance of each patch: emission plus reflectance times irradiance (E/pi). emission, radiance:
// indexed by patch + 1. light: rows of floats, `stride` apart. stand_in: patch whose reflected light replaces each
// patch's own, or null.
__kernel void exitant_radiance(__global const float4 *emission, __global const float4 *reflectance,
                               __global const float *light, const int stride, __global const uint *stand_in,
                               __global float4 *radiance, const int count)
{
    const int i = get_global_id(0);
    if (i >= count)
        return;
    const size_t from = stand_in ? stand_in[i] : i;
    radiance[i + 1] = emission[i + 1] + reflectance[from] * (float4)(vload3(0, light + stride * from), 0.0f);
}
