// Rays through a bounding volume hierarchy of triangles. CUTOUTS is defined for scenes with see-through
// surfaces.

#define STACK 64
#define LEAF_BITS 3

typedef struct {
    __global const float4 *boxes;      // of each inner node: low and high corner of both children
    __global const int2 *children;     // node, or ~(first << LEAF_BITS | count) for a leaf
    __global const float4 *triangles;  // first corner (w: number of the triangle), two edges; in leaf order
#ifdef CUTOUTS
    __global const float *alpha;       // engine/cutouts.py
    __global const int4 *maps;
    __global const float4 *constants;  // alpha, threshold or -1, 1 for culled backs
    __global const float2 *places;     // of each corner of each triangle on its alpha map
    __global const int *materials;     // of each triangle
#endif
} Rays;

#ifdef CUTOUTS
#define RAYS_ARGUMENTS __global const float4 *boxes, __global const int2 *children, \
    __global const float4 *triangles, __global const float *alpha, __global const int4 *maps, \
    __global const float4 *constants, __global const float2 *places, __global const int *materials
#define RAYS {boxes, children, triangles, alpha, maps, constants, places, materials}
#else
#define RAYS_ARGUMENTS __global const float4 *boxes, __global const int2 *children, __global const float4 *triangles
#define RAYS {boxes, children, triangles}
#endif

typedef struct {
    float distance;
    float2 weights;  // of the second and third corner
    int triangle;    // -1 for none
    bool front;
} Hit;

#ifdef CUTOUTS
int wrapped(const int i, const int size, const int extension)
{
    if (extension == 0)
        return i - size * (int)floor((float)i / size);
    if (extension == 1) {
        const int folded = i - 2 * size * (int)floor((float)i / (2 * size));
        return min(folded, 2 * size - 1 - folded);
    }
    return clamp(i, 0, size - 1);
}

float alpha_pixel(const Rays *rays, const int x, const int y, const int4 map)
{
    if (map.w % 4 == 3 && (x < 0 || y < 0 || x >= map.y || y >= map.z))
        return 0.0f;
    return rays->alpha[map.x + wrapped(y, map.z, map.w % 4) * map.y + wrapped(x, map.y, map.w % 4)];
}

float map_alpha(const Rays *rays, const float2 uv, const int4 map)
{
    if (map.y == 0)
        return 1.0f;
    const float2 place = uv * (float2)(map.y, map.z);
    if (map.w >= 4)
        return alpha_pixel(rays, (int)floor(place.x), (int)floor(place.y), map);
    const float2 low = floor(place - 0.5f), f = place - 0.5f - low;
    const int x = (int)low.x, y = (int)low.y;
    return mix(mix(alpha_pixel(rays, x, y, map), alpha_pixel(rays, x + 1, y, map), f.x),
               mix(alpha_pixel(rays, x, y + 1, map), alpha_pixel(rays, x + 1, y + 1, map), f.x), f.y);
}

// The share of light that a surface stops at a hit.
float opacity(const Rays *rays, const Hit *hit)
{
    const int material = rays->materials[hit->triangle];
    const float4 constants = rays->constants[material];
    if (constants.z > 0.0f && !hit->front)
        return 0.0f;
    const float2 w = hit->weights;
    __global const float2 *corner = rays->places + 3 * hit->triangle;
    const float2 uv = corner[0] * (1.0f - w.x - w.y) + corner[1] * w.x + corner[2] * w.y;
    const float alpha = constants.x * map_alpha(rays, uv, rays->maps[material]);
    if (constants.y >= 0.0f)
        return alpha < constants.y ? 0.0f : 1.0f;
    return min(alpha, 1.0f);
}

// What is more transparent than this is passed. DITHERED: partial opacity stops that share of the rays,
// chosen by a hash of where they hit; else half of it is as good as all.
float least_opacity(const Hit *hit)
{
#ifdef DITHERED
    uint seed = as_uint(hit->weights.x) * 0x9e3779b9u ^ as_uint(hit->weights.y) * 0x85ebca6bu ^ (uint)hit->triangle;
    seed = (seed ^ (seed >> 16)) * 0x7feb352du;
    seed = (seed ^ (seed >> 15)) * 0x846ca68bu;
    return ((seed >> 8) + 1) * (1.0f / 16777216.0f);
#else
    return 0.5f;
#endif
}
#endif

// Distance at which a ray enters a box, or INFINITY (slabs; Kay and Kajiya 1986).
float enters(const float4 low, const float4 high, const float3 origin, const float3 inverse, const float nearest)
{
    const float3 a = (low.xyz - origin) * inverse, b = (high.xyz - origin) * inverse;
    const float3 first = fmin(a, b), last = fmax(a, b);
    const float in = fmax(fmax(first.x, first.y), fmax(first.z, 0.0f));
    const float out = fmin(fmin(last.x, last.y), fmin(last.z, nearest));
    return in <= out * 1.0000004f ? in : INFINITY;
}

// Moeller and Trumbore 1997; edges are a little wider than they are, so that nothing slips between.
bool meets(__global const float4 *triangle, const float3 origin, const float3 direction, const float nearest, Hit *hit)
{
    const float3 edge1 = triangle[1].xyz, edge2 = triangle[2].xyz;
    const float3 p = cross(direction, edge2);
    const float determinant = dot(edge1, p);
    if (determinant == 0.0f)
        return false;
    const float inverse = 1.0f / determinant;
    const float3 s = origin - triangle[0].xyz;
    const float u = dot(s, p) * inverse;
    const float3 q = cross(s, edge1);
    const float v = dot(direction, q) * inverse;
    const float distance = dot(edge2, q) * inverse;
    const float rim = 1e-6f;
    if (!(u >= -rim && v >= -rim && u + v <= 1.0f + rim && distance > 0.0f && distance < nearest))
        return false;
    hit->distance = distance;
    hit->weights = (float2)(u, v);
    hit->triangle = as_int(triangle[0].w);
    hit->front = determinant > 0.0f;
    return true;
}

// The share of light that comes through along a ray up to a distance: 1 if nothing is in its way.
float transmittance(const Rays *rays, const float3 origin, const float3 direction, const float distance)
{
    const float3 inverse = 1.0f / direction;
    int stack[STACK], depth = 0, node = 0;
    float through = 1.0f;
    for (;;) {
        if (node >= 0) {
            __global const float4 *box = rays->boxes + 4 * node;
            const float first = enters(box[0], box[1], origin, inverse, distance);
            const float second = enters(box[2], box[3], origin, inverse, distance);
            const int2 children = rays->children[node];
            if (first < INFINITY || second < INFINITY) {
                const bool swap = second < first;
                if (first < INFINITY && second < INFINITY && depth < STACK)
                    stack[depth++] = swap ? children.x : children.y;
                node = swap ? children.y : children.x;
                continue;
            }
        } else {
            const int code = ~node;
            __global const float4 *triangle = rays->triangles + 3 * (code >> LEAF_BITS);
            const int count = code & ((1 << LEAF_BITS) - 1);
            for (int i = 0; i < count; ++i, triangle += 3) {
                Hit hit;
                if (!meets(triangle, origin, direction, distance, &hit))
                    continue;
#ifdef CUTOUTS
                through *= 1.0f - opacity(rays, &hit);
                if (through < 1e-4f)
                    return 0.0f;
#else
                return 0.0f;
#endif
            }
        }
        if (depth == 0)
            return through;
        node = stack[--depth];
    }
}

// The nearest surface along a ray, or the nearest back; holes are passed.
Hit nearest_hit(const Rays *rays, const float3 origin, const float3 direction, const bool backs)
{
    const float3 inverse = 1.0f / direction;
    int stack[STACK], depth = 0, node = 0;
    Hit nearest = {INFINITY, (float2)(0.0f), -1, false};
    for (;;) {
        if (node >= 0) {
            __global const float4 *box = rays->boxes + 4 * node;
            const float first = enters(box[0], box[1], origin, inverse, nearest.distance);
            const float second = enters(box[2], box[3], origin, inverse, nearest.distance);
            const int2 children = rays->children[node];
            if (first < INFINITY || second < INFINITY) {
                const bool swap = second < first;
                if (first < INFINITY && second < INFINITY && depth < STACK)
                    stack[depth++] = swap ? children.x : children.y;
                node = swap ? children.y : children.x;
                continue;
            }
        } else {
            const int code = ~node;
            __global const float4 *triangle = rays->triangles + 3 * (code >> LEAF_BITS);
            const int count = code & ((1 << LEAF_BITS) - 1);
            for (int i = 0; i < count; ++i, triangle += 3) {
                Hit hit;
                if (!meets(triangle, origin, direction, nearest.distance, &hit) || (backs && hit.front))
                    continue;
#ifdef CUTOUTS
                if (opacity(rays, &hit) < least_opacity(&hit))
                    continue;
#endif
                nearest = hit;
            }
        }
        if (depth == 0)
            return nearest;
        node = stack[--depth];
    }
}

// The nearest triangle along each ray, or the nearest that shows its back: number (-1 for none), and 1 for
// its front; its distance.
__kernel void cast(RAYS_ARGUMENTS, __global const float4 *origins, __global const float4 *directions,
                   const int backs, __global int2 *hits, __global float *distances, const int count)
{
    const int i = get_global_id(0);
    if (i >= count)
        return;
    const Rays rays = RAYS;
    const Hit hit = nearest_hit(&rays, origins[i].xyz, directions[i].xyz, backs != 0);
    hits[i] = (int2)(hit.triangle, hit.front);
    distances[i] = hit.distance;
}

// The share of light that comes through along each ray, up to the distance in its direction's w.
__kernel void pass(RAYS_ARGUMENTS, __global const float4 *origins, __global const float4 *directions,
                   __global float *through, const int count)
{
    const int i = get_global_id(0);
    if (i >= count)
        return;
    const Rays rays = RAYS;
    through[i] = transmittance(&rays, origins[i].xyz, directions[i].xyz, directions[i].w);
}
