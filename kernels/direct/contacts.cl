#include "bvh_traversal.cl"
#include "receiver.cl"
#include "validity.cl"

// Results, as in engine/direct/contact.py.
#define NONE 0
#define HIDDEN 1
#define BACK_TO_BACK 2

// Maximum distance between coincident faces, as a fraction of the ray origin's height.
#define ON 0.25f

// Detects patches covered by a touching face. A short ray along the negative normal, from `above` to `below` the
// surface (in ray-origin heights), tests for a back face there. HIDDEN: the patch is covered. BACK_TO_BACK: the two
// faces coincide and both sides are open, as for walls of adjacent rooms or the sides of a leaf; nothing is covered.
// For a box on a floor the floor's side is inside the box, so the floor is HIDDEN.
__kernel void in_contact(RAYS_ARGUMENTS, __global const ReceiverRecord *receivers, const float above, const float below,
                         __global uchar *result, const int count)
{
    const int patch = get_global_id(0);
    if (patch >= count)
        return;
    const Rays rays = RAYS;
    const Receiver r = load_receiver(receivers + patch);
    const float3 up = r.height * r.geometric;
    const Hit hit = nearest_hit(&rays, r.at + above * up, -(above + below) * up, true);
    result[patch] = NONE;
    if (hit.triangle < 0 || hit.distance > 1.0f)
        return;
    const bool on = fabs(above - (above + below) * hit.distance) <= ON;
    bool open = on;
    for (int side = 1; side >= -1 && open; side -= 2)
        open = hits_few_backfaces(&rays, r.at + side * up, side * r.geometric, 0, 0.0f, MAX_BACKS_OPEN);
    result[patch] = open ? BACK_TO_BACK : HIDDEN;
}
