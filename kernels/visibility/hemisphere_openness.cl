#pragma once
#include "bvh_traversal.cl"
#include "receiver.cl"
#include "texel_ray_origins.cl"

// Estimates the unoccluded fraction of a patch's hemisphere from a set of rays.

typedef struct {
    float open, all;  // sum of transmittances; number of rays
} Opening;

// Traces a ray from a point of the texel and adds its transmittance to the estimate. Directions below the geometric
// surface are skipped. place: position in the texel, 0..1.
void look_out(Opening *opening, const Rays *rays, const Receiver *r, const float2 place, const float3 direction,
              const float reach)
{
    if (dot(direction, r->geometric) <= 0.0f)
        return;
    const float3 p = jittered_origin(rays, r, place);
    opening->open += grey_of(transmittance(rays, BOUNCE, p + ray_origin(r, p, direction), direction, reach));
    opening->all += 1.0f;
}

float open_part(const Opening *opening) { return opening->all > 0.0f ? opening->open / opening->all : 0.0f; }
