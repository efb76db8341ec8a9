// Blends the indirect irradiance of both sides of translucent surfaces: each patch of a pair gets the fraction `own` of
// its own side and the rest of the other side (engine/patches/sides.py). Direct light is excluded, because
// sample_direct_light has blended it already. One work item per pair.
__kernel void blend_sides(__global const uint2 *pairs, __global const float4 *own, __global const float4 *direct,
                          __global const float4 *irradiance, __global float4 *gathered, __global float4 *defects,
                          const int column, const int count, const int pair_count)
{
    const int pair = get_global_id(0);
    if (pair >= pair_count)
        return;
    const uint patches[2] = {pairs[pair].x, pairs[pair].y};
    float4 light[2];
    for (int side = 0; side < 2; ++side)
        light[side] = gathered[(size_t)column * count + patches[side]] - direct[patches[side]];
    for (int side = 0; side < 2; ++side) {
        const uint patch = patches[side];
        const float3 weight = own[2 * pair + side].xyz;
        float4 blended = light[side];
        blended.xyz = weight * light[side].xyz + (1.0f - weight) * light[1 - side].xyz;
        blended += direct[patch];
        gathered[(size_t)column * count + patch] = blended;
        defects[(size_t)column * count + patch] = blended - irradiance[patch];
    }
}
