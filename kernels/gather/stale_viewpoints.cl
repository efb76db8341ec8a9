// Marks patches whose viewpoint, orientation, texel or triangle changed since the last bake.

bool same(__global const float *one, __global const float *other)
{
    return one[0] == other[0] && one[1] == other[1] && one[2] == other[2];
}

__kernel void mark_stale_views(__global const ReceiverRecord *before, __global const ReceiverRecord *now,
                               __global uchar *moved, const int count)
{
    const int patch = get_global_id(0);
    if (patch >= count)
        return;
    __global const ReceiverRecord *a = before + patch, *b = now + patch;
    if (!same(a->at, b->at) || !same(a->normal, b->normal) || !same(a->geometric, b->geometric)
        || !same(a->edge_u, b->edge_u) || !same(a->edge_v, b->edge_v) || !same(a->corner, b->corner)
        || !same(a->edge1, b->edge1) || !same(a->edge2, b->edge2) || a->height != b->height || a->rank != b->rank)
        moved[patch] = 1;
}
