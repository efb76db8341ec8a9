#include "bilinear_taps.cl"

// What both sides of seams show: light that differs may be parted by what stands there (engine/postprocess/blocked_seams.py).

// Marks: light of both sides differs, or is not known of both; one side at least reads what nobody sees.
#define OTHER_LIGHT 1
#define READS_HIDDEN 2

// Of texels.
#define SURFACE 1
#define KNOWN 2

// What a look-up shows of texels that are known, how much it reads of those, and of surface that is not.
float3 shown_light(const float2 side, const int atlas, __global const float *light, __global const uchar *texels,
                   const int resolution)
{
    const Footprint f = footprint_at(side, resolution);
    float3 sums = 0.0f;
    for (int corner = 0; corner < 4; ++corner) {
        const uint texel = flat_index(atlas, corner_of(&f, corner), resolution);
        const float weight = weight_of(&f, corner);
        if (texels[texel] & KNOWN)
            sums.xy += weight * (float2)(light[texel], 1.0f);
        else if (texels[texel] & SURFACE)
            sums.z += weight;
    }
    return (float3)(sums.y > 0.0f ? sums.x / sums.y : 0.0f, sums.yz);
}

// light: of each texel; differs: by this part of the larger light it is another one.
__kernel void compare_sides(__global const float4 *sides, __global const int2 *atlases, __global const float *light,
                            __global const uchar *texels, const float differs, __global uchar *marks,
                            const int resolution, const int count)
{
    const int seam = get_global_id(0);
    if (seam >= count)
        return;
    const float3 first = shown_light(sides[seam].xy, atlases[seam].x, light, texels, resolution);
    const float3 second = shown_light(sides[seam].zw, atlases[seam].y, light, texels, resolution);
    const bool unknown = first.y <= 0.0f || second.y <= 0.0f;
    const bool other = unknown || fabs(first.x - second.x) > differs * fmax(first.x, second.x);
    marks[seam] = (other ? OTHER_LIGHT : 0) | (first.z + second.z > 0.0f ? READS_HIDDEN : 0);
}
