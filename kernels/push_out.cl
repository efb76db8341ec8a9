// Ways out for points that are inside of something: all that they see are backs. Rays in the plane of the surface
// look for the nearest back that is met; just outside of it the point is out.

#define WAYS 8  // rays in the plane; opposite ones tell how thick the thing is
#define MARGIN 0.05f  // how far outside a point is moved, in widths of its texel

bool sees_backs_only(const Rays *rays, const Receiver *r, const float3 start, const float3 x, const float3 y)
{
    for (int i = 0; i < LOOKS; ++i) {
        const Hit hit = nearest_hit(rays, start, look(i, x, y, r->geometric), false);
        if (hit.triangle < 0 || hit.front)
            return false;
    }
    return true;
}

// xyz: the way out, 0 for none; w: how thick what the point is in is there, INFINITY if farther than `reach`, m.
// walls: a triangle of it, -1 for points that are not inside; sides: those that it is so thick between.
__kernel void push_out(RAYS_ARGUMENTS, __global const ReceiverRecord *receivers, const float reach,
                       __global float4 *ways, __global int *walls, __global int2 *sides, const int count)
{
    const int point = get_global_id(0);
    if (point >= count)
        return;
    const Rays rays = RAYS;
    const Receiver r = load_receiver(receivers + point);
    const float3 start = r.at + r.height * r.geometric;
    float3 x, y;
    basis(r.geometric, &x, &y);
    ways[point] = (float4)(0.0f, 0.0f, 0.0f, INFINITY);
    walls[point] = -1;
    sides[point] = (int2)(-1);
    if (!sees_backs_only(&rays, &r, start, x, y))
        return;
    float nearest = INFINITY, thickness = INFINITY, distances[WAYS];
    int met[WAYS];
    for (int i = 0; i < WAYS; ++i) {
        const float angle = 2.0f * i / WAYS;
        const float3 direction = cospi(angle) * x + sinpi(angle) * y;
        const Hit hit = nearest_hit(&rays, start, reach * r.size * direction, false);
        const bool back = hit.triangle >= 0 && !hit.front && hit.distance <= 1.0f;
        distances[i] = back ? hit.distance * reach * r.size : INFINITY;
        if (distances[i] < nearest) {
            nearest = distances[i];
            ways[point].xyz = (nearest + MARGIN * r.size + r.height) * direction;
            walls[point] = hit.triangle;
        }
        met[i] = hit.triangle;
        if (i >= WAYS / 2 && distances[i] + distances[i - WAYS / 2] < thickness) {
            thickness = distances[i] + distances[i - WAYS / 2];
            sides[point] = (int2)(met[i], met[i - WAYS / 2]);
        }
    }
    ways[point].w = thickness;
}
