#include "bilinear_taps.cl"

// Compares the irradiance that a bilinear look-up returns on both sides of seams. A difference may come from geometry
// that separates the sides (engine/postprocess/blocked_seams.py).

// Marks of seams. OTHER_LIGHT: both sides differ, or one has no known texel. READS_HIDDEN: one side reads invalid
// texels.
#define OTHER_LIGHT 1
#define READS_HIDDEN 2

// Returns the interpolated irradiance of known texels (x), their weight (y), and the weight of unknown texels of patches
// (z). entries: patch + 1 of each texel, 0 for none.
float3 shown_light(const float2 side, const int atlas, __global const float *light, __global const uchar *known,
                   __global const uint *entries, const int resolution)
{
    const Footprint f = footprint_at(side, resolution);
    float3 sums = 0.0f;
    for (int corner = 0; corner < 4; ++corner) {
        const uint texel = flat_index(atlas, corner_of(&f, corner), resolution);
        const float weight = weight_of(&f, corner);
        if (known[texel])
            sums.xy += weight * (float2)(light[texel], 1.0f);
        else if (entries[texel])
            sums.z += weight;
    }
    return (float3)(sums.y > 0.0f ? sums.x / sums.y : 0.0f, sums.yz);
}

// Marks seams. light: irradiance of each texel; differs: maximum difference as a fraction of the larger side.
__kernel void compare_sides(__global const float4 *sides, __global const int2 *atlases, __global const float *light,
                            __global const uchar *known, __global const uint *entries, const float differs,
                            __global uchar *marks, const int resolution, const int count)
{
    const int seam = get_global_id(0);
    if (seam >= count)
        return;
    const float3 first = shown_light(sides[seam].xy, atlases[seam].x, light, known, entries, resolution);
    const float3 second = shown_light(sides[seam].zw, atlases[seam].y, light, known, entries, resolution);
    const bool unknown = first.y <= 0.0f || second.y <= 0.0f;
    const bool other = unknown || fabs(first.x - second.x) > differs * fmax(first.x, second.x);
    marks[seam] = (other ? OTHER_LIGHT : 0) | (first.z + second.z > 0.0f ? READS_HIDDEN : 0);
}
