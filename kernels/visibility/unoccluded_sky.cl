#pragma once
#include "visibility_sample.cl"
#include "view_samples.cl"

// Ratio estimator for sky light (Heitz, Hill and McGuire, "Combining Analytic Direct Illumination and Stochastic
// Shadows", 2018). The unoccluded irradiance of the sky is tabulated exactly, so the samples estimate only the visible
// fraction, which has less noise.

// Rows and columns of the table, by normal direction (engine/visibility/unoccluded_sky.py).
#define OPEN_ROWS 49
#define OPEN_COLUMNS 96

// Minimum visible sky fraction for the estimator. Below it, occlusion causes most of the noise (chosen).
#define LEAST_OPEN 0.125f

// Limit of the correction factor (chosen).
#define MOST_OFF 2.0f

// Kernel arguments of the sky: radiance map, and `open_sky`, E/pi of the unoccluded sky for a grid of normals; null if
// the sky is uniform or too uneven.
#define SKY_ARGUMENTS \
    __global const float4 *sky, const int sky_width, const int sky_height, __global const float4 *open_sky

// Returns E/pi of the unoccluded sky for a normal: bilinear look-up in the table.
float3 unoccluded_irradiance(const float3 normal, __global const float4 *open_sky)
{
    const float2 at = (float2)((0.5f - atan2pi(normal.y, normal.x) * 0.5f) * OPEN_COLUMNS,
                               (1.0f - acospi(clamp(normal.z, -1.0f, 1.0f))) * (OPEN_ROWS - 1));
    const float2 low = floor(at), f = at - low;
    const int x0 = (int)low.x % OPEN_COLUMNS, x1 = (x0 + 1) % OPEN_COLUMNS;
    const int y0 = clamp((int)low.y, 0, OPEN_ROWS - 1), y1 = min(y0 + 1, OPEN_ROWS - 1);
    const float4 below = mix(open_sky[y0 * OPEN_COLUMNS + x0], open_sky[y0 * OPEN_COLUMNS + x1], f.x);
    const float4 above = mix(open_sky[y1 * OPEN_COLUMNS + x0], open_sky[y1 * OPEN_COLUMNS + x1], f.x);
    return mix(below, above, f.y).xyz;
}

// Scales each work item's sum of visible sky light by the exact unoccluded irradiance divided by its estimate from the
// same samples. w of the sum is the visible fraction.
void scale_to_sky(ViewSum *seen, const View *view, SAMPLES, const int samples, const int n, SKY_ARGUMENTS,
                  __local float4 *partial)
{
#ifdef COSINE
    if (!open_sky || sum_of_group(seen->light, partial).w < LEAST_OPEN)
        return;
    float4 met = (float4)(0.0f);
    for (int i = get_local_id(0); i < samples; i += get_local_size(0))
        met +=
            background_radiance(sample_direction(view, i, pattern, n), sky, (int2)(sky_width, sky_height)) * WEIGHT(i);
    const float3 all = fmax(sum_of_group(met, partial).xyz, 1e-20f);
    const float3 factor = clamp(unoccluded_irradiance(view->normal, open_sky) / all, 1.0f / MOST_OFF, MOST_OFF);
    seen->light.xyz *= factor;
#ifdef DIRECTIONAL
    seen->l1.x.xyz *= factor;
    seen->l1.y.xyz *= factor;
    seen->l1.z.xyz *= factor;
#endif
#endif
}

// Adds the scaled sky light to the other light of a view; w stays.
void add_sky(ViewSum *sum, const ViewSum *seen)
{
    sum->light.xyz += seen->light.xyz;
#ifdef DIRECTIONAL
    sum->l1.x += seen->l1.x;
    sum->l1.y += seen->l1.y;
    sum->l1.z += seen->l1.z;
#endif
}
