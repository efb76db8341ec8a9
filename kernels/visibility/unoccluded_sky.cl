#pragma once
#include "visibility_sample.cl"
#include "view_samples.cl"

// The light of the sky that views see, with less noise than their samples leave: what the whole sky would bring is
// known, so that samples only tell what part of it comes through (a ratio estimator; Heitz, Hill and McGuire,
// "Combining Analytic Direct Illumination and Stochastic Shadows", 2018).

// Rows and columns of the table (engine/visibility/unoccluded_sky.py).
#define OPEN_ROWS 49
#define OPEN_COLUMNS 96

// The part of a view from which on it pays: of little sky most noise is that of what hides it.
#define LEAST_OPEN 0.125f

// Largest factor between what samples of the whole sky bring and what it brings.
#define MOST_OFF 2.0f

// The sky: radiance, and `open_sky`, E/pi of all of it at normals on a grid, or 0 if it is uniform or uneven.
#define SKY_ARGUMENTS __global const float4 *sky, const int sky_width, const int sky_height, \
    __global const float4 *open_sky

// E/pi at a surface from which nothing hides the sky.
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

// Scale each item's sum of the sky that a view's samples meet by what the whole sky brings over what all samples
// would sum up if nothing hid it. w of the sum is the part of the view that the sky takes.
void scale_to_sky(ViewSum *seen, const View *view, SAMPLES, const int samples, const int n, SKY_ARGUMENTS,
                  __local float4 *partial)
{
#ifdef COSINE
    if (!open_sky || sum_of_group(seen->light, partial).w < LEAST_OPEN)
        return;
    float4 met = (float4)(0.0f);
    for (int i = get_local_id(0); i < samples; i += get_local_size(0))
        met += surroundings(sample_direction(view, i, pattern, n), sky, (int2)(sky_width, sky_height)) * WEIGHT(i);
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

// Add the sky that a view meets to all else; w stays.
void add_sky(ViewSum *sum, const ViewSum *seen)
{
    sum->light.xyz += seen->light.xyz;
#ifdef DIRECTIONAL
    sum->l1.x += seen->l1.x;
    sum->l1.y += seen->l1.y;
    sum->l1.z += seen->l1.z;
#endif
}
