// One iteration for several light groups at once (kernels/gather.cl is that of one): each number of a patch is read
// once, and stands for LIGHT_GROUPS radiances that lie side by side.

// Adds what a patch, plus 1, sends out of each group.
void add_radiances(__global const float4 *radiance, const uint patch, const float weight, float4 *sums)
{
    __global const float4 *of_patch = radiance + (size_t)patch * LIGHT_GROUPS;
#pragma unroll
    for (int group = 0; group < LIGHT_GROUPS; ++group)
        sums[group] += weight * of_patch[group];
}

// radiance: of each patch + 1 that of all groups. All other light: of each patch that of all groups, patch 0 first.
__kernel void gather_groups(__global const Front4 *cache, __global const float4 *multiplier,
                            __global const float4 *radiance, LIGHT_ARGUMENTS, const int quads, const int first,
                            __local float4 *partial)
{
    const int slot = get_group_id(0);
    __global const Front4 *row = cache + (size_t)slot * quads;
    float4 sums[LIGHT_GROUPS];
#pragma unroll
    for (int group = 0; group < LIGHT_GROUPS; ++group)
        sums[group] = (float4)(0.0f);
    for (int i = get_local_id(0); i < quads; i += get_local_size(0)) {
        const Front4 seen = row[i];
#ifdef EVEN
        const float4 weight = (float4)(1.0f);
#else
        const float4 weight = multiplier[i];
#endif
        add_radiances(radiance, seen.x, weight.x, sums);
        add_radiances(radiance, seen.y, weight.y, sums);
        add_radiances(radiance, seen.z, weight.z, sums);
        add_radiances(radiance, seen.w, weight.w, sums);
    }
#pragma unroll
    for (int group = 0; group < LIGHT_GROUPS; ++group) {
        float4 sum = sum_of_group(sums[group], partial);
#ifdef EVEN
        sum /= 4.0f * quads;
#endif
        if (get_local_id(0) == 0)
            STORE(sum, (first + slot) * LIGHT_GROUPS + group);
    }
}
