#pragma once
#include "bvh_traversal.glsl"
#include "receiver.glsl"

// Probe rays: a few cosine-distributed directions around a receiver's normal. The same as
// kernels/visibility/probe_rays.cl.

#define LOOKS 16

vec3 probe_direction(const int i, const vec3 x, const vec3 y, const vec3 z)
{
    return cosine_direction(vec2((float(i) + 0.5) / float(LOOKS), float(i) * 0.618034), x, y, z);
}
