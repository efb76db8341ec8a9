#pragma once
#include "view_samples.glsl"

// Background light, and the ratio estimator for sky light. The same algorithms as in
// kernels/visibility/hemicube_directions.cl and kernels/visibility/unoccluded_sky.cl.

uniform int first_sky, sky_width, sky_height, has_open_sky, first_open_sky;

// Rows and columns of the table of unoccluded irradiance, by normal direction (engine/visibility/unoccluded_sky.py).
#define OPEN_ROWS 49
#define OPEN_COLUMNS 96

// Minimum visible sky fraction for the ratio estimator. Below it, occlusion causes most of the noise (chosen).
#define LEAST_OPEN 0.125

// Limit of the ratio between the sky's unoccluded irradiance and its estimate from the samples.
#define MOST_OFF 2.0

// Interpolates four pixels of a map bilinearly. first: word of the map's first pixel. width: pixels per row.
vec3 mixed(const int first, const int width, const ivec4 at, const vec2 f)
{
    vec3 below = mix(view_vec3(first + 4 * (at.z * width + at.x)), view_vec3(first + 4 * (at.z * width + at.y)), f.x);
    vec3 above = mix(view_vec3(first + 4 * (at.w * width + at.x)), view_vec3(first + 4 * (at.w * width + at.y)), f.x);
    return mix(below, above, f.y);
}

// Returns the background radiance in a world-space direction: bilinear look-up in an equirectangular map whose row 0 is
// at the bottom (Cycles, kernel/camera/projection.h).
vec3 background_radiance(const vec3 direction)
{
    if (sky_width * sky_height == 1)
        return view_vec3(first_sky);
    float azimuth = atan(direction.y, direction.x) * 0.318309886183791;
    float polar = 1.0 - acos(clamp(direction.z / length(direction), -1.0, 1.0)) * 0.318309886183791;
    vec2 pixel = vec2((0.5 - azimuth * 0.5) * float(sky_width), polar * float(sky_height)) - 0.5;
    vec2 low = floor(pixel);
    int x = (int(low.x) + sky_width) % sky_width;
    ivec2 y = clamp(ivec2(int(low.y), int(low.y) + 1), 0, sky_height - 1);
    return mixed(first_sky, sky_width, ivec4(x, (x + 1) % sky_width, y), pixel - low);
}

// Returns E/pi of the unoccluded sky for a normal: bilinear look-up in the table.
vec3 unoccluded_irradiance(const vec3 normal)
{
    float azimuth = atan(normal.y, normal.x) * 0.318309886183791;
    float polar = 1.0 - acos(clamp(normal.z, -1.0, 1.0)) * 0.318309886183791;
    vec2 at = vec2((0.5 - azimuth * 0.5) * float(OPEN_COLUMNS), polar * float(OPEN_ROWS - 1)), low = floor(at);
    int x = int(low.x) % OPEN_COLUMNS, y = clamp(int(low.y), 0, OPEN_ROWS - 1);
    return mixed(first_open_sky, OPEN_COLUMNS, ivec4(x, (x + 1) % OPEN_COLUMNS, y, min(y + 1, OPEN_ROWS - 1)),
                 at - low);
}

// Returns the factor for the visible sky light of a view: the exact unoccluded irradiance divided by its estimate from
// the same samples (ratio estimator; Heitz, Hill and McGuire 2018). part: visible fraction of the sky.
vec3 factor_of_sky(const View view, const float part)
{
    if (has_open_sky == 0 || part < LEAST_OPEN)
        return vec3(1.0);
    vec3 all = vec3(0.0);
    for (int i = 0; i < samples; ++i)
        all += background_radiance(sample_direction(view, i)) / float(samples);
    return clamp(unoccluded_irradiance(view.normal) / max(all, 1e-20), 1.0 / MOST_OFF, MOST_OFF);
}
