// A point is not inside of anything if more than this many of its looks meet something else than a back.
#define OTHERS 3

// 1 for patches that see little but backs, and among them that of a triangle that shines.
__kernel void lit_by_backs(RAYS_ARGUMENTS, __global const ReceiverRecord *receivers, __global const uchar *shines,
                           __global uchar *result, const int count)
{
    const int patch = get_global_id(0);
    if (patch >= count)
        return;
    const Rays rays = RAYS;
    const Receiver r = load_receiver(receivers + patch);
    float3 x, y;
    basis(r.geometric, &x, &y);
    int others = 0;
    bool lit = false;
    for (int i = 0; i < LOOKS && !lit && others <= OTHERS; ++i) {
        const Hit hit = nearest_hit(&rays, r.at + r.height * r.geometric, look(i, x, y, r.geometric), false);
        const bool back = hit.triangle >= 0 && !hit.front;
        lit = back && shines[hit.triangle];
        others += !back;
    }
    result[patch] = lit;
}
