#pragma once
#include "bvh_traversal.cl"
#include "receiver.cl"

// Probe rays: a few cosine-distributed directions around a receiver's normal.

#define LOOKS 16

float3 probe_direction(const int i, const float3 x, const float3 y, const float3 z)
{
    return cosine_direction((float2)((i + 0.5f) / LOOKS, i * 0.618034f), x, y, z);
}
