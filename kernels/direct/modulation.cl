#pragma once

// Modulation of lights by their shader nodes: an angular profile (IES or baked) and a distance falloff.
// engine/direct/modulation.py packs the lights, engine/scene/profile.py the profiles.

typedef struct {
    __global const Modulation *lamps;
    __global const float *profiles;  // one after another
} Modulations;

// Returns the interval of ascending angles that contains a value (binary search).
int interval_of(__global const float *angles, const int count, const float value)
{
    int low = 0, high = count - 1;
    while (high - low > 1) {
        const int middle = (low + high) / 2;
        if (angles[middle] <= value)
            low = middle;
        else
            high = middle;
    }
    return low;
}

// Returns cubic interpolation weights of four neighbours at t between the middle two (Catmull and Rom 1974).
float4 cubic_weights(const float t)
{
    return (float4)(t * (t * (1.0f - 0.5f * t) - 0.5f), 1.0f + t * t * (1.5f * t - 2.5f),
                    t * (0.5f + t * (2.0f - 1.5f * t)), 0.5f * t * t * (t - 1.0f));
}

// Returns a profile's factor, rgb, along a direction in the light's space; 0 outside its angles.
float3 profile_factor(__global const float *profile, const float3 direction)
{
    const int azimuths = (int)profile[0], polars = (int)profile[1];
    __global const float *azimuth = profile + 2, *polar = azimuth + azimuths, *factors = polar + polars;
    const float phi = fmin(atan2(direction.x, direction.y) + M_PI_F, 2.0f * M_PI_F);
    const float theta = atan2(length(direction.xy), -direction.z);
    if (phi < azimuth[0] || phi > azimuth[azimuths - 1] || theta < polar[0] || theta > polar[polars - 1])
        return (float3)(0.0f);
    const int column = interval_of(azimuth, azimuths, phi), row = interval_of(polar, polars, theta);
    const float4 across = cubic_weights((phi - azimuth[column]) / (azimuth[column + 1] - azimuth[column]));
    const float4 along = cubic_weights((theta - polar[row]) / (polar[row + 1] - polar[row]));
    const float weights[4] = {across.x, across.y, across.z, across.w};
    float3 sum = (float3)(0.0f);
    for (int i = 0; i < 4; ++i) {
        __global const float *f = factors + 3 * ((column + i) * (polars + 2) + row);
        sum += weights[i]
            * (along.x * vload3(0, f) + along.y * vload3(1, f) + along.z * vload3(2, f) + along.w * vload3(3, f));
    }
    return fmax(sum, 0.0f);
}

// Returns the factor of a light's strength along a direction away from it, at a distance in metres.
float3 modulation(const Modulations *modulations, const int number, const float3 away, const float distance)
{
    __global const Modulation *lamp = modulations->lamps + number;
    float3 factor = (float3)(1.0f);
    if (lamp->profile > 0) {
        const float3 x = vload3(0, lamp->x), y = vload3(0, lamp->y), z = vload3(0, lamp->z);
        const float3 own = (float3)(dot(x, away), dot(y, away), dot(z, away));
        factor = profile_factor(modulations->profiles + lamp->profile, own);
    }
    if (distance < INFINITY) {
        const float d2 = distance * distance, smooth = lamp->falloff_smooth;
        factor *= pown(distance, lamp->falloff_power) * (smooth > 0.0f ? d2 / (smooth + d2) : 1.0f);
    }
    return factor;
}
