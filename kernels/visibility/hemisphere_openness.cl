#pragma once
#include "bvh_traversal.cl"
#include "receiver.cl"
#include "texel_ray_origins.cl"

// Which part of a hemisphere is open: sums over rays of a patch.

typedef struct {
    float open, all;  // of the rays: what came through, and their number
} Opening;

// Adds a ray that leaves a place of the texel, unless it would lead below the surface.
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
