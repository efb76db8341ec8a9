#include "receiver.cl"

// Marks patches whose direct light may have changed after objects moved: patches that moved themselves, and patches
// with moved geometry between them and a light.

// Returns the maximum distance of shadow-ray origins from the centre of a patch (ray_origin, jittered_origin), metres.
float reach_of(const Receiver *r)
{
    const float3 edge3 = r->edge2 - r->edge1;
    const float longest = sqrt(fmax(fmax(dot(r->edge1, r->edge1), dot(r->edge2, r->edge2)), dot(edge3, edge3)));
    return 1.001f * (0.5f * (length(r->edge_u) + length(r->edge_v)) + 2.0f * r->height + r->lifted * longest);
}

// Returns true if a ball intersects the convex hull of two other balls: radius `here` at the origin, radius `there` at
// `to`. Minimises |t to - centre| - (1 - t) here - t there, a convex function of t in 0..1.
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

// Stores 1 for each patch to be lit again.
// lights: bounding balls of all targets of shadow rays (engine/direct/stale_shadows.py).
// before, now: receiver records of the patches.
// moved: bounding ball of moved geometry at both positions, centre and radius.
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
            marked =
                dot(to, r.normal) > -(reach + light->radius) && is_between(centre, moved.w, reach, to, light->radius);
        } else {
            marked = dot(centre, r.normal) > -(reach + moved.w);
        }
    }
    marks[patch] = marked;
}
