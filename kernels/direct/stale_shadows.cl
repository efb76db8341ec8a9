#include "receiver.cl"

// Which patches may be lit otherwise once something has moved: those that receive light elsewhere than before, and those
// that it may come, or have been, between and a light.

// How far from the centre of a patch the rays to lights may start (ray_origin, jittered_origin).
float reach_of(const Receiver *r)
{
    const float3 edge3 = r->edge2 - r->edge1;
    const float longest = sqrt(fmax(fmax(dot(r->edge1, r->edge1), dot(r->edge2, r->edge2)), dot(edge3, edge3)));
    return 1.001f * (0.5f * (length(r->edge_u) + length(r->edge_v)) + 2.0f * r->height + r->lifted * longest);
}

// Whether a ball meets what two others span, of which the first, of the radius `here`, is at the origin: the least of
// |t to - centre| - (1 - t) here - t there, a convex function of t, is at most the ball's radius.
bool is_between(const float3 centre, const float radius, const float here, const float3 to, const float there)
{
    const float apart = length(to), growth = (there - here) / fmax(apart, 1e-30f);
    float t = growth < 0.0f ? 0.0f : 1.0f;
    if (fabs(growth) < 1.0f) {
        const float along = dot(centre, to) / apart, off = length(centre - along * to / apart);
        t = clamp((along + off * growth * rsqrt(1.0f - growth * growth)) / apart, 0.0f, 1.0f);
    }
    return length(t * to - centre) <= here + t * (there - here) + radius;
}

// lights: balls around all that shadow rays go to (engine/direct/stale_shadows.py). before, now: records of the patches.
// moved: centre and radius of a ball around what has moved, as it was and as it is. 1 for patches to be lit anew.
__kernel void mark_stale_shadows(__global const ReceiverRecord *before, __global const ReceiverRecord *now,
                                 __global const LightBall *lights, const int light_count, const float4 moved,
                                 __global uchar *marks, const int count)
{
    const int patch = get_global_id(0);
    if (patch >= count)
        return;
    __global const uint *one = (__global const uint *)(before + patch), *other = (__global const uint *)(now + patch);
    bool marked = false;
    for (int i = 0; i < (int)(sizeof(ReceiverRecord) / sizeof(uint)); ++i)
        marked |= one[i] != other[i];

    const Receiver r = load_receiver(now + patch);
    const float reach = reach_of(&r);
    const float3 centre = moved.xyz - r.at;
    marked |= length(centre) <= reach + moved.w;
    for (int i = 0; i < light_count && !marked; ++i) {
        __global const LightBall *light = lights + i;
        const float3 at = vload3(0, light->at);
        if (light->kind == FAR) {
            const float distance = 2.0f * (length(centre) + moved.w);
            marked = is_between(centre, moved.w, reach, distance * at, reach + distance * light->radius);
        } else if (light->kind == NEAR) {
            const float3 to = at - r.at;
            marked = dot(to, r.normal) > -(reach + light->radius)
                && is_between(centre, moved.w, reach, to, light->radius);
        } else {
            marked = dot(centre, r.normal) > -(reach + moved.w);
        }
    }
    marks[patch] = marked;
}
