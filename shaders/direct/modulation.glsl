#pragma once
#include "bvh_traversal.glsl"

// Modulation of lights by their shader nodes: an angular profile (IES or baked) and a distance falloff. The same
// algorithm as kernels/direct/modulation.cl. MODULATED is defined for scenes with such lights: compiling it takes
// llvmpipe as long as all other code of direct.comp.

// Tables of the light's samples, see engine/direct/shader_shadow_rays.py.
layout(std430, binding = 6) readonly buffer LightTables { uint light_tables[]; };
uniform int first_modulations, first_profiles;

float table_float(const int i) { return uintBitsToFloat(light_tables[i]); }
vec3 table_vec3(const int i) { return vec3(table_float(i), table_float(i + 1), table_float(i + 2)); }

#ifdef MODULATED
// Number of 32-bit words of a record `Modulation`, and offsets of its last fields.
#define MODULATION_WORDS 12
#define MODULATION_PROFILE 9
#define MODULATION_POWER 10
#define MODULATION_SMOOTH 11

// Returns the interval of ascending angles that contains a value (binary search). angles: word of the first angle.
int interval_of(const int angles, const int count, const float value)
{
    int low = 0, high = count - 1;
    while (high - low > 1) {
        int middle = (low + high) / 2;
        if (table_float(angles + middle) <= value)
            low = middle;
        else
            high = middle;
    }
    return low;
}

// Returns cubic interpolation weights of four neighbours at t between the middle two (Catmull and Rom 1974).
vec4 cubic_weights(const float t)
{
    return vec4(t * (t * (1.0 - 0.5 * t) - 0.5), 1.0 + t * t * (1.5 * t - 2.5), t * (0.5 + t * (2.0 - 1.5 * t)),
                0.5 * t * t * (t - 1.0));
}

// Returns a profile's factor, rgb, along a direction in the light's space; 0 outside its angles. profile: its first
// word.
vec3 profile_factor(const int profile, const vec3 direction)
{
    int azimuths = int(table_float(profile)), polars = int(table_float(profile + 1));
    int azimuth = profile + 2, polar = azimuth + azimuths, factors = polar + polars;
    float phi = min(atan(direction.x, direction.y) + float(PI), 2.0 * float(PI));
    float theta = atan(length(direction.xy), -direction.z);
    if (phi < table_float(azimuth) || phi > table_float(azimuth + azimuths - 1) || theta < table_float(polar)
        || theta > table_float(polar + polars - 1))
        return vec3(0.0);
    int column = interval_of(azimuth, azimuths, phi), row = interval_of(polar, polars, theta);
    float azimuth0 = table_float(azimuth + column), polar0 = table_float(polar + row);
    vec4 across = cubic_weights((phi - azimuth0) / (table_float(azimuth + column + 1) - azimuth0));
    vec4 along = cubic_weights((theta - polar0) / (table_float(polar + row + 1) - polar0));
    vec3 sum = vec3(0.0);
    for (int i = 0; i < 4; ++i) {
        int f = factors + 3 * ((column + i) * (polars + 2) + row);
        sum += across[i] * (along.x * table_vec3(f) + along.y * table_vec3(f + 3) + along.z * table_vec3(f + 6)
                            + along.w * table_vec3(f + 9));
    }
    return max(sum, 0.0);
}

// Returns the factor of a light's strength along a direction away from it, at a distance in metres.
vec3 modulation(const int number, const vec3 away, const float distance)
{
    int lamp = first_modulations + MODULATION_WORDS * number;
    int profile = int(light_tables[lamp + MODULATION_PROFILE]), power = int(light_tables[lamp + MODULATION_POWER]);
    float smooth_ = table_float(lamp + MODULATION_SMOOTH);
    vec3 factor = vec3(1.0);
    if (profile > 0) {
        vec3 own = vec3(dot(table_vec3(lamp), away), dot(table_vec3(lamp + 3), away), dot(table_vec3(lamp + 6), away));
        factor = profile_factor(first_profiles + profile, own);
    }
    if (distance < INFINITY) {
        float d2 = distance * distance;
        factor *= (power == 0 ? 1.0 : pow(distance, float(power))) * (smooth_ > 0.0 ? d2 / (smooth_ + d2) : 1.0);
    }
    return factor;
}
#endif
