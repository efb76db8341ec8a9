#include "bvh_traversal.cl"
#include "receiver.cl"
#include "validity.cl"

// Points inside of something: what they see are backs, and fronts that are inside, too. Rays in the plane of the
// surface look for the nearest back; of points that see nothing but backs the way out ends just outside of it.

#define WAYS 8  // rays in the plane; opposite ones tell how thick the thing is
#define MARGIN 0.05f  // how far outside a point is moved, in widths of its texel

// Whether a look sees out: it meets nothing, or a front that itself sees more than backs. From between the sides of
// a thin wall that ends in another wall, the front of the other one is seen, too; it sees nothing but backs.
bool escapes(const Rays *rays, const Hit *hit, const float3 at, const float height, __global const float *normals,
             __global const uchar *lit, const float near)
{
    if (hit->triangle < 0 || !hit->front)
        return !meets_dark_back(hit, lit, near);
    const float3 normal = vload3(hit->triangle, normals);
    return hits_few_backfaces(rays, at + height * normal, normal, lit, near, MAX_BACKS_OUTSIDE);
}

bool is_inside(const Rays *rays, const Receiver *r, const float3 start, const float3 x, const float3 y,
               __global const float *normals, __global const uchar *lit, bool *backs_only)
{
    const float near = LIT_FROM * r->size;
    int backs = 0, out = 0, fronts = 0;
    Hit first[FIRST_PROBES];
    for (int i = 0; i < FIRST_PROBES; ++i) {
        first[i] = nearest_hit(rays, start, probe_direction(i, x, y, r->geometric), false);
        backs += meets_dark_back(&first[i], lit, near);
    }
    for (int i = 0; i < LOOKS && backs > 0 && out <= MAX_ESCAPES; ++i) {
        const float3 direction = probe_direction(i, x, y, r->geometric);
        const Hit hit = i < FIRST_PROBES ? first[i] : nearest_hit(rays, start, direction, false);
        fronts += !meets_dark_back(&hit, lit, near);
        out += escapes(rays, &hit, start + hit.distance * direction, r->height, normals, lit, near);
    }
    *backs_only = fronts == 0;
    return backs > 0 && out <= MAX_ESCAPES;
}

// ways: xyz the way out, m, 0 for none; w how thick the thing is that the point is in, m, INFINITY if its sides are
// farther than `reach`. walls: a triangle of it, -1 if none is near. sides: the two triangles that the thickness is
// measured between. inside: 1 for points inside of something; of others nothing else is written. normals: of the
// triangles; lit: see meets_dark_back.
__kernel void push_off(RAYS_ARGUMENTS, __global const ReceiverRecord *receivers, __global const float *normals,
                       __global const uchar *lit, const float reach, __global float4 *ways, __global int *walls, __global int2 *sides,
                       __global uchar *inside, const int count)
{
    const int point = get_global_id(0);
    if (point >= count)
        return;
    const Rays rays = RAYS;
    const Receiver r = load_receiver(receivers + point);
    const float3 start = r.at + r.height * r.geometric;
    float3 x, y;
    basis(r.geometric, &x, &y);
    bool backs_only;
    inside[point] = is_inside(&rays, &r, start, x, y, normals, lit, &backs_only);
    if (!inside[point])
        return;
    ways[point] = (float4)(0.0f, 0.0f, 0.0f, INFINITY);
    walls[point] = -1;
    sides[point] = (int2)(-1);
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
            walls[point] = hit.triangle;
            if (backs_only)
                ways[point].xyz = (nearest + MARGIN * r.size + r.height) * direction;
        }
        met[i] = hit.triangle;
        if (i >= WAYS / 2 && distances[i] + distances[i - WAYS / 2] < thickness) {
            thickness = distances[i] + distances[i - WAYS / 2];
            sides[point] = (int2)(met[i], met[i - WAYS / 2]);
        }
    }
    ways[point].w = thickness;
}

// The ways of some points, close together.
__kernel void compact_push_offs(__global const float4 *ways, __global const int *walls, __global const int2 *sides,
                                __global const int *points, __global float4 *taken, __global int *taken_walls,
                                __global int2 *taken_sides, const int count)
{
    const int i = get_global_id(0);
    if (i >= count)
        return;
    taken[i] = ways[points[i]];
    taken_walls[i] = walls[points[i]];
    taken_sides[i] = sides[points[i]];
}
