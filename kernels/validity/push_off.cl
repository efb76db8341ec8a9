#include "bvh_traversal.cl"
#include "receiver.cl"
#include "validity.cl"

// Push-off: moves sample points inside geometry to the nearest outside. A point is inside if its probe rays hit only
// back faces, or front faces that lie inside too. Rays in the tangent plane find the nearest back face; a point with
// only back faces around it moves just beyond that face.

#define WAYS 8        // rays in the tangent plane; opposite rays measure the thickness
#define MARGIN 0.05f  // distance of a moved point from the face, in texel widths
#define INSIDE 1      // results of the test, as in engine/validity/push_off.py
#define ENCLOSED 2

// Returns how far a probe ray indicates the outside: 2 if it hits nothing, or a front face that is outside itself; 1 if
// it hits a lit back face at a distance, which also occurs in pockets that light leaks into; else 0. From a point
// between the sides of a thin wall that ends in another wall, rays also hit the other wall's front, which is inside
// there.
int escape(const Rays *rays, const Hit *hit, const float3 at, const float height, __global const float *normals,
           __global const uchar *lit, const float near)
{
    if (hit->triangle < 0)
        return 2;
    if (!hit->front)
        return !meets_dark_back(hit, lit, near);
    const float3 normal = vload3(hit->triangle, normals);
    return 2 * hits_few_backfaces(rays, at + height * normal, normal, lit, near, MAX_BACKS_OUTSIDE);
}

// Returns true if the first probe rays of a point prove that it is outside: none hits a dark back face, and one reaches
// farther than `near`. In a crevice inside geometry, all of them may hit front faces close by.
bool is_clearly_outside(const Rays *rays, const float3 start, const float3 x, const float3 y, const float3 z,
                        __global const uchar *lit, const float near)
{
    bool far = false;
    for (int i = 0; i < FIRST_PROBES; ++i) {
        const Hit hit = nearest_hit(rays, start, probe_direction(i, x, y, z), false);
        if (meets_dark_back(&hit, lit, near))
            return false;
        far |= hit.triangle < 0 || hit.distance > near;
    }
    return far;
}

// Tests a point by its probe rays: returns INSIDE if it is inside geometry, ENCLOSED if it is not but all except
// MAX_BACKS_OUTSIDE of the rays hit back faces, dark or lit; else 0. near: see meets_dark_back, metres. backs_only: set
// to true if all rays hit back faces.
uchar test_point(const Rays *rays, const Receiver *r, const float3 start, const float3 x, const float3 y,
                 __global const float *normals, __global const uchar *lit, const float near, bool *backs_only)
{
    int out = 0, fronts = 0;
    if (is_clearly_outside(rays, start, x, y, r->geometric, lit, near))
        return 0;
    for (int i = 0; i < LOOKS && (out <= MAX_ESCAPES || fronts <= MAX_BACKS_OUTSIDE); ++i) {
        const float3 direction = probe_direction(i, x, y, r->geometric);
        const Hit hit = nearest_hit(rays, start, direction, false);
        fronts += hit.triangle < 0 || hit.front;
        if (out <= MAX_ESCAPES)
            out += escape(rays, &hit, start + hit.distance * direction, r->height, normals, lit, near);
    }
    *backs_only = fronts == 0;
    if (out <= MAX_ESCAPES)
        return INSIDE;
    return fronts <= MAX_BACKS_OUTSIDE ? ENCLOSED : 0;
}

// Computes the push-off of each point inside geometry; nothing else is written for other points.
// ways: xyz the displacement, metres, 0 for none; w the thickness of the object around the point, metres, INFINITY if
//     its sides are farther than `reach` texels.
// walls: nearest triangle of the object, or -1. sides: the two triangles between which thickness is measured.
// tested: INSIDE, ENCLOSED or 0, see test_point. normals: of the triangles. lit: see meets_dark_back. reach: width
//     of a texel in widths of the points; more than 1 if points are parts of texels.
__kernel void push_off(RAYS_ARGUMENTS, __global const ReceiverRecord *receivers, __global const float *normals,
                       __global const uchar *lit, const float reach, __global float4 *ways, __global int *walls,
                       __global int2 *sides, __global uchar *tested, const int count)
{
    const int point = get_global_id(0);
    if (point >= count)
        return;
    const Rays rays = RAYS;
    const Receiver r = load_receiver(receivers + point);
    const float3 start = r.at + r.height * r.geometric;
    float3 x, y;
    basis(r.geometric, &x, &y);
    bool backs_only = false;
    tested[point] = test_point(&rays, &r, start, x, y, normals, lit, LIT_FROM * reach * r.size, &backs_only);
    if (tested[point] != INSIDE)
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

// Gathers the results of the chosen points into columns of `count` words: offset, thickness, wall. The thickness is
// INFINITY unless the cosine between the normals of both sides is below `apart`.
__kernel void compact_push_offs(__global const float4 *ways, __global const int *walls, __global const int2 *sides,
                                __global const float *normals, const float apart, __global const int *points,
                                __global float *taken, const int count)
{
    const int i = get_global_id(0);
    if (i >= count)
        return;
    const int2 both = sides[points[i]];
    const bool opposite = both.x >= 0 && dot(vload3(both.x, normals), vload3(both.y, normals)) < apart;
    const float4 way = ways[points[i]];
    const float words[] = {way.x, way.y, way.z, opposite ? way.w : INFINITY, as_float(walls[points[i]])};
    for (int column = 0; column < 5; ++column)
        taken[(size_t)column * count + i] = words[column];
}
