#include "bvh_traversal.cl"
#include "receiver.cl"
#include "validity.cl"

// How far apart faces are, in heights of the eye, that lie on one another.
#define ON 0.25f

// HIDDEN for patches that a face hides which touches them: a ray against the geometric normal, from `above` to
// `below` the surface, both in heights of the eye, meets the back of that face. BACK_TO_BACK where the two faces
// lie on one another and both see something else than backs: they are the walls of two rooms that share a plane,
// or the sides of a leaf, and hide nothing. Of a floor and the box on it one sees the inside of the box.
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
    result[patch] = on && is_outside(&rays, r.at + up, r.geometric) && is_outside(&rays, r.at - up, -r.geometric)
        ? BACK_TO_BACK : HIDDEN;
}
