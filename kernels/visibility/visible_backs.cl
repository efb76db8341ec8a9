#define DITHERED
#include "bvh_traversal.cl"
#include "receiver.cl"
#include "probe_rays.cl"
#include "texel_ray_origins.cl"

// Back faces in view of surfaces (engine/visibility/rays/visible_backs.py).

// Returns the triangle from which a ray starts: the first whose range ends after the ray's number.
int start_triangle(const uint ray, __global const uint *ends, const int triangles)
{
    int low = 0, high = triangles - 1;
    while (low < high) {
        const int middle = (low + high) / 2;
        if (ray < ends[middle])
            high = middle;
        else
            low = middle + 1;
    }
    return low;
}

// Mark of a back face that an earlier round found. No ray writes it, so reading it is no race.
#define KNOWN 2

// Origin and direction of a test ray, and of a second, parallel ray.
typedef struct {
    float3 start, beside, direction;
} TestRay;

// Returns the triangle whose back face a test ray hits, -1 for none. A ray exactly through the common edge of two
// triangles may miss both and hit a back face behind them, so the parallel ray from `beside` must hit a back face too.
int back_met(const Rays *rays, const TestRay *ray)
{
    const Hit hit = nearest_hit(rays, ray->start, ray->direction, false);
    if (hit.triangle < 0 || hit.front)
        return -1;
    const Hit other = nearest_hit(rays, ray->beside, ray->direction, false);
    return other.triangle >= 0 && !other.front ? hit.triangle : -1;
}

// Returns true if a probe ray hits a back face that no earlier round found.
bool meets_unknown_back(const Rays *rays, const float3 start, const float3 direction, __global const uchar *marks)
{
    const Hit hit = nearest_hit(rays, start, direction, false);
    return hit.triangle >= 0 && !hit.front && marks[hit.triangle] != KNOWN;
}

// Returns true if a point lies inside geometry, such as the floor below a box: all of its probe rays hit back faces
// that no earlier round found. A ray counts as a hit if it or the parallel ray from `beside` hits; see `back_met`.
bool is_enclosed(const Rays *rays, const TestRay *ray, const float3 x, const float3 y, const float3 normal,
                 __global const uchar *marks)
{
    bool enclosed = true;
    for (int i = 0; i < LOOKS && enclosed; ++i) {
        const float3 direction = probe_direction(i, x, y, normal);
        enclosed = meets_unknown_back(rays, ray->start, direction, marks)
            || meets_unknown_back(rays, ray->beside, direction, marks);
    }
    return enclosed;
}

// Marks each triangle whose back face a test ray hits. Origins are spread over the triangles, directions are
// cosine-distributed. Rays with an origin inside geometry do not count.
// corners: 9 floats per triangle. side: 1 for rays from front faces, -1 from back faces. height: of origins above the
//     surface, and distance of parallel rays, metres. marks: per triangle, KNOWN or 0 before; set to 1 by a hit.
// enclosed: one bit per ray, set if its origin is inside geometry and the ray hits a new back face.
// again: not 0 to repeat only the rays of `enclosed`; all other rays would hit the same triangles.
// first: number of the first ray of this launch.
__kernel void mark_visible_backs(RAYS_ARGUMENTS, __global const float *corners, __global const uint *ends,
                                 const int triangle_count, const float side, const float height, __global uchar *marks,
                                 __global uint *enclosed, const int again, const uint first, const int count)
{
    if (get_global_id(0) >= count)
        return;
    const uint number = first + get_global_id(0), bit = 1u << (number & 31);
    if (again && !(enclosed[number >> 5] & bit))
        return;
    const Rays rays = RAYS;
    const int triangle = start_triangle(number, ends, triangle_count);
    const float3 corner = vload3(3 * triangle, corners);
    const float3 edge1 = vload3(3 * triangle + 1, corners) - corner, edge2 = vload3(3 * triangle + 2, corners) - corner;
    float2 w = place_of_sample(number, (uint2)(0));
    w = w.x + w.y > 1.0f ? 1.0f - w : w;
    const float3 normal = side * normalize(cross(edge1, edge2));
    float3 x, y;
    basis(normal, &x, &y);
    const uint2 lot = (uint2)(hash(number), hash(number ^ 0x9e3779b9u)) >> 8;
    TestRay ray;
    ray.direction = cosine_direction(convert_float2(lot) * (1.0f / 16777216.0f), x, y, normal);
    ray.start = corner + w.x * edge1 + w.y * edge2 + height * normal;
    ray.beside = ray.start + height * x;
    const int met = back_met(&rays, &ray);
    if (met < 0 || met == triangle || marks[met])
        return;
    if (!is_enclosed(&rays, &ray, x, y, normal, marks))
        marks[met] = 1;
    else if (!again)
        atomic_or(&enclosed[number >> 5], bit);
}
