#pragma once
#include "image_borders.cl"

// Ray traversal of a BVH with WIDTH boxes per node and leaves of packets of PACKET triangles (RECORD floats per
// triangle). STACK is the traversal stack's size (engine/visibility/rays/bvh.py chooses all four). TRANSMISSION is
// defined for scenes with transparent surfaces, TINTED if some of them colour the light that passes, ANGULAR if some of
// them are glass, which transmits less at larger angles of incidence.

#define JOIN_(a, b) a##b
#define JOIN(a, b) JOIN_(a, b)
#define FLOATS JOIN(float, WIDTH)
#define INTS JOIN(int, WIDTH)
#if WIDTH == 2
#define PLANES float4
#elif WIDTH == 4
#define PLANES float8
#define LANE_BITS (int4)(1, 2, 4, 8)
#define JOINED(i) (i.s0 | i.s1 | i.s2 | i.s3)
#else
#define PLANES float16
#define LANE_BITS (int8)(1, 2, 4, 8, 16, 32, 64, 128)
#define JOINED(i) (i.s0 | i.s1 | i.s2 | i.s3 | i.s4 | i.s5 | i.s6 | i.s7)
#endif

// Returns a bit mask of the lanes whose flags are set. With AVX this is one instruction (movmskps).
#if WIDTH == 8 && defined(__AVX__)
#define BITS_OF(flags) __builtin_ia32_movmskps256(as_float8(flags))
#elif WIDTH > 2
int bits_of(const INTS flags)
{
    const INTS bits = flags & LANE_BITS;
    return JOINED(bits);
}
#define BITS_OF(flags) bits_of(flags)
#endif
#if PACKET == 1
#define PART float4
#define PARTS 3
#define LANES float
#define FLAGS int
#define ANY(flags) (flags)
#define LANE(values, lane) (values)
#define FLAG(flags, lane) (flags)
#else
#define PART JOIN(float, PACKET)
#define PARTS 10
#define LANES PART
#define FLAGS JOIN(int, PACKET)
#if PACKET == WIDTH
#define ANY(flags) BITS_OF(flags)
#else
#define ANY(flags) any(flags)
#endif
#define LANE(values, lane) ((const float *)&(values))[lane]
#define FLAG(flags, lane) ((const int *)&(flags))[lane]
#endif
#define LEAF_BITS 3

// On a CPU each kind of traversal is compiled once as a function, with its search mode inlined as a constant.
#if WIDTH == 2
#define DESCENT
#define PART_OF_DESCENT
#else
#define DESCENT __attribute__((noinline))
#define PART_OF_DESCENT __attribute__((always_inline)) inline
#endif

typedef struct {
    PLANES x, y, z;  // planes of the children's boxes: low, then high; for WIDTH 2 centres, then half sizes
    INTS children;   // a child is a node, or ~(first packet << LEAF_BITS | packets) for a leaf
    INTS unused;
} Node;

typedef struct {
    __global const Node *nodes;
    __global const PART *triangles;  // packets of first corner, two edges, number
#ifdef TRANSMISSION
    __global const ushort *pixels;           // values of all maps (engine/scene/cutouts.py)
    __global const Transmittance *surfaces;  // four of each material
    __global const float2 *map_uvs;          // of each corner of each triangle on its maps, layer by layer
    __global const int *materials;           // of each triangle
#endif
#ifdef TINTED
    __global const float4 *tints;  // engine/scene/tints.py
#endif
} Rays;

#ifdef TINTED
#define RAYS_ARGUMENTS \
    __global const Node *nodes, __global const PART *triangles, __global const ushort *pixels, \
        __global const Transmittance *surfaces, __global const float2 *map_uvs, __global const int *materials, \
        __global const float4 *tints
#define RAYS {nodes, triangles, pixels, surfaces, map_uvs, materials, tints}
#elif defined(TRANSMISSION)
#define RAYS_ARGUMENTS \
    __global const Node *nodes, __global const PART *triangles, __global const ushort *pixels, \
        __global const Transmittance *surfaces, __global const float2 *map_uvs, __global const int *materials
#define RAYS {nodes, triangles, pixels, surfaces, map_uvs, materials}
#else
#define RAYS_ARGUMENTS __global const Node *nodes, __global const PART *triangles
#define RAYS {nodes, triangles}
#endif

typedef struct {
    float distance;
    float2 weights;  // barycentrics of the second and third corner
    int triangle;    // -1 for none
    bool front;
#ifdef TINTED
    bool tinted;  // light from the hit passes coloured surfaces
#endif
} Hit;

// Kinds of transmittance: for shadow rays to lights, and for all other rays. BACK_SIDE is added for back faces.
#define SHADOW 0
#define BOUNCE 1
#define BACK_SIDE 2

// Fraction of light that passes or is stopped: three channels if surfaces colour light (TINTED), else one.
#ifdef TINTED
typedef float3 Fraction;
float largest(const Fraction f) { return fmax(f.x, fmax(f.y, f.z)); }
float smallest(const Fraction f) { return fmin(f.x, fmin(f.y, f.z)); }
float grey_of(const Fraction f) { return dot(f, (float3)(0.2126f, 0.7152f, 0.0722f)); }
#else
typedef float Fraction;
float largest(const Fraction f) { return f; }
float smallest(const Fraction f) { return f; }
float grey_of(const Fraction f) { return f; }
#endif

#ifdef TRANSMISSION
Fraction map_pixel(const Rays *rays, const int x, const int y, __global const Transmittance *map)
{
    if (map->extension == 3 && (x < 0 || y < 0 || x >= map->width || y >= map->height))
        return (Fraction)(0.0f);
    const int row = wrapped(y, map->height, map->extension), column = wrapped(x, map->width, map->extension);
    const int pixel = row * map->width + column;
#ifdef TINTED
    __global const ushort *values = rays->pixels + map->first + map->channels * pixel;
    const int second = map->channels > 1 ? 1 : 0, third = map->channels > 1 ? 2 : 0;
    return (float3)(values[0], values[second], values[third]) / 65535.0f;
#else
    return rays->pixels[map->first + pixel] / 65535.0f;
#endif
}

Fraction map_value(const Rays *rays, const float2 uv, __global const Transmittance *map)
{
    const float2 pixel = near_image(uv, map->extension) * (float2)(map->width, map->height);
    if (map->nearest)
        return map_pixel(rays, (int)floor(pixel.x), (int)floor(pixel.y), map);
    const float2 low = floor(pixel - 0.5f), f = pixel - 0.5f - low;
    const int x = (int)low.x, y = (int)low.y;
    return mix(mix(map_pixel(rays, x, y, map), map_pixel(rays, x + 1, y, map), f.x),
               mix(map_pixel(rays, x, y + 1, map), map_pixel(rays, x + 1, y + 1, map), f.x), f.y);
}

#ifdef TINTED
#define OF_CHANNELS(values) vload3(0, values)
#else
#define OF_CHANNELS(values) (values)[0]
#endif

#ifdef ANGULAR
// Returns the fraction of light that a face of glass transmits: sqrt((1 - F) / (1 + F)), with the unpolarised Fresnel
// reflectance F (engine/scene/transmission.py). cosine: of the angle of incidence.
float through_face(const float cosine, const float ior)
{
    const float squared = ior * ior - 1.0f + cosine * cosine;
    if (!(squared > 0.0f))
        return 0.0f;
    const float g = sqrt(squared), first = (g - cosine) / (g + cosine);
    const float second = (cosine * (g + cosine) - 1.0f) / (cosine * (g - cosine) + 1.0f);
    const float reflected = fmin(0.5f * first * first * (1.0f + second * second), 1.0f);
    return sqrt((1.0f - reflected) / (1.0f + reflected));
}

// Returns the opacity of glass at an angle of incidence, from its opacity at normal incidence. The two sides of a
// closed body together transmit as two faces (`body_transmittance` of engine/scene/transmission.py).
Fraction at_angle(const Fraction stopped, __global const Transmittance *surface, const float cosine)
{
    if (!(surface->share > 0.0f))
        return stopped;
    const float face = through_face(cosine, surface->ior) / fmax(through_face(1.0f, surface->ior), 1e-15f);
    const Fraction passed = (1.0f - stopped) * (1.0f - surface->share * (1.0f - pow(face, surface->faces)));
    if (surface->body < 0.5f)
        return 1.0f - passed;
    const Fraction squared = passed * passed;
    return surface->body < 1.5f ? 0.5f - 0.5f * squared : (1.0f - squared) / (1.0f + squared);
}
#endif

// Returns the opacity of a surface at a point of a triangle: base plus factor times map value, then alpha clip or clamp
// to 0..1. weights: barycentrics of the second and third corner. kind: SHADOW or BOUNCE. cosine: of the angle of
// incidence, for ANGULAR.
Fraction opacity(const Rays *rays, const int triangle, const float2 w, const bool front, const int kind,
                 const float cosine)
{
    __global const Transmittance *surface =
        rays->surfaces + 4 * rays->materials[triangle] + (front ? kind : BACK_SIDE + kind);
    Fraction stopped = OF_CHANNELS(surface->base);
    if (surface->width > 0) {
        __global const float2 *corner = rays->map_uvs + surface->first_corner + 3 * triangle;
        const float2 uv = corner[0] * (1.0f - w.x - w.y) + corner[1] * w.x + corner[2] * w.y;
        stopped += OF_CHANNELS(surface->factor) * map_value(rays, uv, surface);
    }
    if (surface->threshold >= 0.0f) {
        const Fraction limit = (Fraction)(surface->threshold);
        return select((Fraction)(1.0f), (Fraction)(0.0f), stopped < limit);
    }
#ifdef ANGULAR
    return at_angle(clamp(stopped, 0.0f, 1.0f), surface, cosine);
#else
    return clamp(stopped, 0.0f, 1.0f);
#endif
}

// Returns the smallest opacity that stops a ray at this hit. With DITHERED it is a pseudo-random number from a hash of
// the hit point, so that partial opacity stops that fraction of all rays. Without, it is 1/2.
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

// Search modes of a traversal: product of transmittances up to a distance (ALL), nearest opaque hit, nearest opaque
// back-face hit, any hit regardless of opacity, or tint of the surfaces passed (TINTS).
#define ALL 0
#define NEAREST 1
#define NEAREST_BACK 2
#define ANYTHING 3
#define TINTS 4

// Maximum ray length. Nearer than the boxes at infinity that stand for missing children.
#define FARTHEST 1e38f

// Relative distance added to back-face hits, so that a coplanar front face wins.
#define BACK_FARTHER 1e-5f

typedef struct {
    float3 origin, direction, inverse;
    int sought;
    float reach;       // maximum ray parameter, in lengths of the direction
    Fraction through;  // product of transmittances so far
    Hit nearest;
#ifdef TRANSMISSION
    int kind;  // SHADOW or BOUNCE
#endif
#ifdef TINTED
    bool tinted;  // a coloured transparent surface was passed, perhaps behind the nearest hit
#endif
} Search;

// Slab test (Kay and Kajiya 1986): computes `axis_in` and `axis_out`, the ray parameters at which a ray enters and
// leaves the boxes along one axis. GPUs select low or high planes at half the speed of a multiplication, so nodes of
// two children store centre and half size, enlarged for rounding (bvh.cl).
#if WIDTH == 2
#define SLAB(axis) \
    const FLOATS axis##_middle = (node->axis.lo - search->origin.axis) * search->inverse.axis; \
    const FLOATS axis##_half = (FLOATS)(fabs(search->inverse.axis)); \
    const FLOATS axis##_in = mad(-node->axis.hi, axis##_half, axis##_middle); \
    const FLOATS axis##_out = mad(node->axis.hi, axis##_half, axis##_middle)
#else
#define SLAB(axis) \
    __global const FLOATS *axis = (__global const FLOATS *)&node->axis; \
    const int axis##_far = search->inverse.axis < 0.0f ? 0 : 1; \
    const FLOATS axis##_in = (axis[1 - axis##_far] - search->origin.axis) * search->inverse.axis; \
    const FLOATS axis##_out = (axis[axis##_far] - search->origin.axis) * search->inverse.axis
#endif

// Returns flags of the children whose boxes the ray hits, and in `in` the ray parameters at which it enters them. The
// factor covers rounding (Ize 2013). The inverse direction is finite, so no value is NaN.
PART_OF_DESCENT INTS boxes_met(__global const Node *node, const Search *search, FLOATS *in)
{
    SLAB(x);
    SLAB(y);
    SLAB(z);
    *in = max(max(x_in, y_in), max(z_in, 0.0f));
    return *in <= min(min(x_out, y_out), min(z_out, search->reach)) * 1.0000004f;
}

// Intersections of one ray with a packet of triangles: distance, barycentrics, determinant, and hit flags per lane.
typedef struct {
    LANES distance, u, v, determinant;
    FLAGS met;
} Meeting;

// Ray-triangle intersection by Moeller and Trumbore 1997. Triangles are enlarged by 1e-6 in barycentrics, so that rays
// cannot slip between neighbours.
PART_OF_DESCENT void meet(const LANES *t, const Search *search, Meeting *meeting)
{
    const float3 d = search->direction;
    const LANES sx = search->origin.x - t[0], sy = search->origin.y - t[1], sz = search->origin.z - t[2];
    const LANES px = d.y * t[8] - d.z * t[7], py = d.z * t[6] - d.x * t[8], pz = d.x * t[7] - d.y * t[6];
    const LANES qx = sy * t[5] - sz * t[4], qy = sz * t[3] - sx * t[5], qz = sx * t[4] - sy * t[3];
    const LANES determinant = t[3] * px + t[4] * py + t[5] * pz, inverse = 1.0f / determinant;
    const LANES u = (sx * px + sy * py + sz * pz) * inverse;
    const LANES v = (d.x * qx + d.y * qy + d.z * qz) * inverse;
    const LANES distance = (t[6] * qx + t[7] * qy + t[8] * qz) * inverse;
    const float rim = 1e-6f;
    meeting->met = (determinant != 0.0f) & (u >= -rim) & (v >= -rim) & (u + v <= 1.0f + rim) & (distance > 0.0f)
        & (distance < search->reach);
    if (search->sought == NEAREST_BACK)
        meeting->met &= determinant < 0.0f;
    meeting->determinant = determinant;
    meeting->distance = distance;
    meeting->u = u;
    meeting->v = v;
}

// Loads a packet of a leaf and intersects it with the ray.
PART_OF_DESCENT void meet_packet(__global const PART *packet, const Search *search, Meeting *meeting)
{
#if PACKET == 1
    const float4 a = packet[0], b = packet[1], c = packet[2];
    const float t[10] = {a.x, a.y, a.z, a.w, b.x, b.y, b.z, b.w, c.x, c.y};
#else
    const LANES t[9] = {packet[0], packet[1], packet[2], packet[3], packet[4],
                        packet[5], packet[6], packet[7], packet[8]};
#endif
    meet(t, search, meeting);
}

#ifdef ANGULAR
// Returns the cosine of the angle of incidence on a triangle of a packet. determinant: of `meet`.
float cosine_of_incidence(__global const PART *packet, const int lane, const float determinant, const float3 direction)
{
    __global const float *t = (__global const float *)packet + lane;
    const float3 edge1 = (float3)(t[3 * PACKET], t[4 * PACKET], t[5 * PACKET]);
    const float3 edge2 = (float3)(t[6 * PACKET], t[7 * PACKET], t[8 * PACKET]);
    return fmin(fabs(determinant) / (length(cross(edge1, edge2)) * length(direction)), 1.0f);
}
#endif

// Merges the hits of a packet into the search. Returns false once the search is complete (ray fully blocked).
#if PACKET == 8 && !defined(TRANSMISSION)
// Variant for opaque scenes on CPUs: takes the nearest lane by a vector minimum.
PART_OF_DESCENT bool take_packet(const Rays *rays, __global const PART *packet, const Meeting *meeting, Search *search)
{
    if (search->sought == ALL)
        return false;
    LANES distance = meeting->distance;
    if (search->sought == NEAREST)
        distance += (meeting->determinant < 0.0f) ? BACK_FARTHER * distance : 0.0f;
    distance = meeting->met ? distance : INFINITY;
    const float4 four = min(distance.lo, distance.hi);
    const float2 two = min(four.lo, four.hi);
    const float least = min(two.x, two.y);
    if (!(least < search->reach))
        return true;
    const int here = BITS_OF(distance == least), lane = 31 - clz(here & -here);
    const Hit hit = {least, (float2)(LANE(meeting->u, lane), LANE(meeting->v, lane)),
                     ((__global const int *)packet)[9 * PACKET + lane], LANE(meeting->determinant, lane) > 0.0f};
    search->nearest = hit;
    search->reach = least;
    return true;
}
#else
// General variant: processes lanes in order, with transparency.
PART_OF_DESCENT bool take_packet(const Rays *rays, __global const PART *packet, const Meeting *meeting, Search *search)
{
    for (int lane = 0; lane < PACKET; ++lane) {
        const bool front = LANE(meeting->determinant, lane) > 0.0f;
        float distance = LANE(meeting->distance, lane);
        if (!front && (search->sought == NEAREST || search->sought == TINTS))
            distance += BACK_FARTHER * distance;
        if (!FLAG(meeting->met, lane) || !(distance < search->reach))
            continue;
        const Hit hit = {distance, (float2)(LANE(meeting->u, lane), LANE(meeting->v, lane)),
                         ((__global const int *)packet)[9 * PACKET + lane], front};
#ifdef TRANSMISSION
#ifdef ANGULAR
        const float cosine = cosine_of_incidence(packet, lane, LANE(meeting->determinant, lane), search->direction);
#else
        const float cosine = 1.0f;
#endif
        const Fraction stopped = opacity(rays, hit.triangle, hit.weights, front, search->kind, cosine);
        const float least = least_opacity(&hit);
#else
        const Fraction stopped = 1.0f;
        const float least = 0.5f;
#endif
        if (search->sought == ALL) {
            search->through *= 1.0f - stopped;
            if (largest(search->through) < 1e-4f)
                return false;
#ifdef TINTED
        } else if (search->sought == TINTS) {
            const Fraction passed = 1.0f - stopped;
            if (hit.triangle != search->nearest.triangle && largest(passed) > 0.0f)
                search->through *= passed / largest(passed);
#endif
        } else if (smallest(stopped) >= least) {
            search->nearest = hit;
            search->reach = distance;
        }
#ifdef TINTED
        else if (largest(stopped) > smallest(stopped))
            search->tinted = true;
#endif
    }
    return true;
}
#endif

// Tests all packets of a leaf. Returns false once the search is complete.
PART_OF_DESCENT bool take_leaf(const Rays *rays, const int code, Search *search)
{
    __global const PART *packet = rays->triangles + PARTS * (code >> LEAF_BITS);
    const int count = code & ((1 << LEAF_BITS) - 1);
    for (int i = 0; i < count; ++i, packet += PARTS) {
        Meeting meeting;
        meet_packet(packet, search, &meeting);
        if (!ANY(meeting.met))
            continue;
        if (search->sought == ANYTHING || !take_packet(rays, packet, &meeting, search))
            return false;
    }
    return true;
}

// The traversal stack holds nodes still to be visited; `depth` is its height. `go_down` enters the nearest child hit
// and pushes the others, farthest first. `go_back` pops the next node. Both return false if none is left. `begins`
// holds the entry distance of each pushed node: wide nodes push several, and most start behind a hit found meanwhile.
// `depth` is separate from the stack, so that it can stay in a register.
#if WIDTH == 2
bool go_down(int *stack, float *begins, int *depth, const INTS met, const FLOATS in, const INTS children, int *node)
{
    if (!(met.x | met.y))
        return false;
    const bool second = met.y && (!met.x || in.y < in.x);
    if (met.x && met.y)
        stack[(*depth)++] = second ? children.x : children.y;
    *node = second ? children.y : children.x;
    return true;
}

bool go_back(const int *stack, const float *begins, int *depth, const float reach, int *node)
{
    if (*depth == 0)
        return false;
    *node = stack[--*depth];
    return true;
}
#else
PART_OF_DESCENT bool go_down(int *stack, float *begins, int *depth, const INTS met, const FLOATS in,
                             const INTS children, int *node)
{
    int entered = BITS_OF(met);
    if (entered == 0)
        return false;
    const int first = *depth, lane = 31 - clz(entered);
    float nearest = ((const float *)&in)[lane];
    *node = ((const int *)&children)[lane];
    while (entered ^= 1 << (31 - clz(entered))) {
        const int other = 31 - clz(entered);
        float begin = ((const float *)&in)[other];
        int child = ((const int *)&children)[other];
        if (begin < nearest) {
            const float nearest_before = nearest;
            const int node_before = *node;
            nearest = begin;
            *node = child;
            begin = nearest_before;
            child = node_before;
        }
        int at = (*depth)++;
        for (; at > first && begins[at - 1] < begin; --at) {
            stack[at] = stack[at - 1];
            begins[at] = begins[at - 1];
        }
        stack[at] = child;
        begins[at] = begin;
    }
    return true;
}

PART_OF_DESCENT bool go_back(const int *stack, const float *begins, int *depth, const float reach, int *node)
{
    do {
        if (*depth == 0)
            return false;
        *node = stack[--*depth];
    } while (begins[*depth] > reach);
    return true;
}
#endif

// Traverses the BVH, near children first (while-while loop of Aila and Laine 2009): GPU lanes descend until each has
// reached a leaf, then all test triangles together.
PART_OF_DESCENT void descend(const Rays *rays, Search *search)
{
    int stack[STACK], depth = 0, node = 0;
    float begins[WIDTH == 2 ? 1 : STACK];
    for (;;) {
        while (node >= 0) {
            __global const Node *wide = rays->nodes + node;
            FLOATS in;
            const INTS met = boxes_met(wide, search, &in);
            if (!go_down(stack, begins, &depth, met, in, wide->children, &node)
                && !go_back(stack, begins, &depth, search->reach, &node))
                return;
        }
        if (!take_leaf(rays, ~node, search)) {
            search->through = (Fraction)(0.0f);
            return;
        }
        if (!go_back(stack, begins, &depth, search->reach, &node))
            return;
    }
}

PART_OF_DESCENT Search search_for(const int sought, const int kind, const float3 origin, const float3 direction,
                                  const float reach)
{
    const Search search = {origin, direction,        clamp(1.0f / direction, -1e30f, 1e30f), sought,
                           reach,  (Fraction)(1.0f), {INFINITY, (float2)(0.0f), -1, false},
#ifdef TRANSMISSION
                           kind
#endif
    };
    return search;
}

// Returns the transmittance along a ray up to a distance: 1 if unoccluded, 0 if blocked. kind: SHADOW or BOUNCE,
// selects the transmittance of surfaces.
DESCENT Fraction transmittance(const Rays *rays, const int kind, const float3 origin, const float3 direction,
                               const float distance)
{
    Search search = search_for(ALL, kind, origin, direction, distance);
    descend(rays, &search);
    return search.through;
}

// Returns true if a ray hits any triangle, including transparent ones and back faces.
DESCENT bool meets_anything(const Rays *rays, const float3 origin, const float3 direction)
{
    Search search = search_for(ANYTHING, BOUNCE, origin, direction, INFINITY);
    descend(rays, &search);
    return largest(search.through) == 0.0f;
}

// Returns the nearest opaque hit along a ray, or the nearest opaque back-face hit if `backs`. Transparent points are
// passed.
DESCENT Hit nearest_hit(const Rays *rays, const float3 origin, const float3 direction, const bool backs)
{
    Search search = search_for(backs ? NEAREST_BACK : NEAREST, BOUNCE, origin, direction, FARTHEST);
    descend(rays, &search);
#ifdef TINTED
    search.nearest.tinted = search.tinted;
#endif
    return search.nearest;
}

#ifdef TINTED
// Returns the tint, rgb, of light that arrives along a ray from a hit or the sky. The ray passed each transparent
// surface with a probability equal to the largest channel of its transmittance; the tint is the product of the
// remaining factors transmittance / largest channel.
DESCENT float3 tint_of_way(const Rays *rays, const float3 origin, const float3 direction, const Hit *hit)
{
    Search search = search_for(TINTS, BOUNCE, origin, direction, fmin(hit->distance, FARTHEST));
    search.nearest.triangle = hit->triangle;
    descend(rays, &search);
    return search.through;
}
#endif
