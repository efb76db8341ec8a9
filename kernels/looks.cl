#pragma once
#include "rays.cl"
#include "receiver.cl"

// A few rays around a receiver's normal, which follow the cosine.

#define LOOKS 16

float3 look(const int i, const float3 x, const float3 y, const float3 z)
{
    return cosine_direction((float2)((i + 0.5f) / LOOKS, i * 0.618034f), x, y, z);
}

// Whether so many of the looks from a point meet a back at most. No more are cast than it takes to know.
bool sees_few_backs(const Rays *rays, const float3 start, const float3 normal, const int most)
{
    float3 x, y;
    basis(normal, &x, &y);
    int backs = 0;
    for (int i = 0; backs <= most && i - backs < LOOKS - most; ++i) {
        const Hit hit = nearest_hit(rays, start, look(i, x, y, normal), false);
        backs += hit.triangle >= 0 && !hit.front;
    }
    return backs <= most;
}

// A patch that sees more backs than other things is inside of something.
bool sees_out(const Rays *rays, const float3 start, const float3 normal)
{
    return sees_few_backs(rays, start, normal, LOOKS / 2);
}
