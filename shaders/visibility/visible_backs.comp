#version 430
// Marks each triangle whose back face a test ray hits, as kernels/visibility/visible_backs.cl does.
#define RECEIVER_ACCESS readonly
#define DITHERED
#include "bvh_traversal.glsl"
#include "receiver.glsl"
#include "probe_rays.glsl"
#include "texel_ray_origins.glsl"

layout(local_size_x = 64) in;
layout(std430, binding = 4) readonly buffer Corners { float corners[]; };  // 9 of each triangle, metres
layout(std430, binding = 5) readonly buffer Ends { uint ends[]; };         // end of each triangle's range of rays
layout(std430, binding = 6) buffer Enclosed { uint enclosed[]; };          // a bit of each ray, see the kernel
layout(std430, binding = 7) buffer Marks { uint marks[]; };                // 0 or KNOWN before, 1 for found ones
uniform int start, end, triangle_count, again;
uniform float side, height;

// Mark of a back face that an earlier round found. No ray writes it, so reading it is no race.
#define KNOWN 2u

vec3 corner_of(const int triangle, const int k)
{
    int i = 9 * triangle + 3 * k;
    return vec3(corners[i], corners[i + 1], corners[i + 2]);
}

// Returns the triangle from which a ray starts: the first whose range ends after the ray's number.
int start_triangle(const uint ray)
{
    int low = 0, high = triangle_count - 1;
    while (low < high) {
        int middle = (low + high) / 2;
        if (ray < ends[middle])
            high = middle;
        else
            low = middle + 1;
    }
    return low;
}

void main()
{
    int ray = start + int(gl_GlobalInvocationID.x);
    uint bit = 1u << (uint(ray) & 31u);
    if (ray >= end || again != 0 && (enclosed[ray >> 5] & bit) == 0u)
        return;
    int triangle = start_triangle(uint(ray)), met = -1;
    vec3 corner = corner_of(triangle, 0);
    vec3 edge1 = corner_of(triangle, 1) - corner, edge2 = corner_of(triangle, 2) - corner;
    vec2 w = place_of_sample(ray, uvec2(0u));
    w = w.x + w.y > 1.0 ? 1.0 - w : w;
    vec3 normal = side * normalize(cross(edge1, edge2)), x, y;
    basis(normal, x, y);
    vec2 lot = vec2(uvec2(hash(uint(ray)), hash(uint(ray) ^ 0x9e3779b9u)) >> 8) * (1.0 / 16777216.0);
    vec3 origin = corner + w.x * edge1 + w.y * edge2 + height * normal;
    vec3 direction = cosine_direction(lot, x, y, normal);
    // The test ray, then the probes, each with its parallel ray: one place in the code for all rays, since drivers
    // inline every call. As back_met and is_enclosed of the kernel.
    for (int i = -2; i < 2 * LOOKS; ++i) {
        bool is_beside = (i & 1) != 0;
        if (i >= 0 && !is_beside)
            direction = probe_direction(i / 2, x, y, normal);
        Hit hit = nearest_hit(is_beside ? origin + height * x : origin, direction, false);
        bool is_back = hit.triangle >= 0 && !hit.front;
        if (i < 0) {
            if (!is_back)
                return;
            if (!is_beside) {
                if (hit.triangle == triangle || marks[hit.triangle] != 0u)
                    return;
                met = hit.triangle;
            }
        } else if (is_back && marks[hit.triangle] != KNOWN) {
            i |= 1;  // this probe meets something unknown, so its parallel ray is not needed
        } else if (is_beside) {
            marks[met] = 1u;
            return;
        }
    }
    if (again == 0)
        atomicOr(enclosed[ray >> 5], bit);
}
