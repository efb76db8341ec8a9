#pragma once
#include "bvh_traversal.cl"
#include "emitters.cl"

// Returns which transmittance applies to an emitter's light. Emissive surfaces and the sky are also gathered as
// indirect light, so they use BOUNCE, for equal attenuation of both parts.
int kind_of_rays(__global const Emitter *e)
{
    return e->kind == SKY_MAP || (e->kind == TRIANGLE && e->triangle >= 0) ? BOUNCE : SHADOW;
}
