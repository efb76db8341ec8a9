#include "bvh_traversal.cl"
#include "receiver.cl"
#include "emitters.cl"
#include "emitter_rays.cl"

// Samples of lights that cameras see, by points on them. Built with SPHERE: light has no cosine factor.

// Stores the direction of each point of the emitters and, if nothing hides it, its light as irradiance at normal
// incidence: `samples` points of each emitter.
__kernel void sample_lights(RAYS_ARGUMENTS, __global const Emitter *emitters, __global const Modulation *modulations,
                            __global const float *profiles, const float4 point, const int samples,
                            __global float4 *directions, __global float4 *light, const int count)
{
    const int i = get_global_id(0);
    if (i >= count)
        return;
    const Rays rays = RAYS;
    const Glow glow = {0};
    const Bright sky = {0};
    const Modulations tables = {modulations, profiles};
    const Receiver r = {.at = point.xyz};
    const int emitter = i / samples;
    const Sample s =
        sample_emitter(emitters + emitter, &glow, &sky, &tables, &r, r.at, sample_point(i % samples, hash(emitter)).xy);
    directions[i] = (float4)(s.direction, 0.0f);
    light[i] = (float4)(0.0f);
    if (!(luminance(s.light) > 0.0f))
        return;
    const bool far = s.distance == INFINITY;
    const Fraction visible =
        transmittance(&rays, BOUNCE, r.at, far ? s.direction : s.distance * s.direction, far ? INFINITY : 0.9998f);
    light[i].xyz = s.light * visible * (M_PI_F / samples);
}
