#pragma once
#include "angular.glsl"
#include "image_borders.glsl"

// Ray traversal of a binary BVH (engine/visibility/rays/shaders/host_bvh.py). The same algorithm as
// kernels/rays/bvh_traversal.cl. STACK is the depth of the BVH. TRANSMISSION is defined for scenes with transparent
// surfaces, TINTED if some of them colour the light that passes, ANGULAR if some of them are glass, which transmits
// less at larger angles of incidence.

#define INFINITY uintBitsToFloat(0x7f800000u)
#define PI 3.14159265358979
#define INVERSE_PI 0.318309886183791
#define LEAF_BITS 3
#define LEAF_STEPS 4  // triangles of a leaf, at most

layout(std430, binding = 0) readonly buffer Nodes { uvec4 nodes[]; };
layout(std430, binding = 1) readonly buffer TriangleRecords { uvec4 triangle_records[]; };

// Kinds of transmittance: for shadow rays to lights, and for all other rays. BACK_SIDE is added for back faces.
#define SHADOW 0
#define BOUNCE 1
#define BACK_SIDE 2

// Fraction of light that passes or is stopped: three channels if surfaces colour light (TINTED), else one.
#ifdef TINTED
#define Fraction vec3
float largest(const vec3 f) { return max(f.x, max(f.y, f.z)); }
float smallest(const vec3 f) { return min(f.x, min(f.y, f.z)); }
float grey_of(const vec3 f) { return dot(f, vec3(0.2126, 0.7152, 0.0722)); }
#else
#define Fraction float
#endif
float largest(const float f) { return f; }
float smallest(const float f) { return f; }
float grey_of(const float f) { return f; }

struct Hit {
    float distance;
    vec2 weights;  // barycentrics of the second and third corner
    int triangle;  // -1 for none
    bool front;
    bool tinted;   // light of it comes through tinted surfaces
};

#ifdef TRANSMISSION
// Buffer with the records of surfaces, four per material; pixels of all maps, two per word; UVs of corners on the maps,
// layer by layer; materials of triangles; tints (engine/visibility/rays/shaders/shader_tracer.py).
layout(std430, binding = 2) readonly buffer TransmissionTables { uint transmission_tables[]; };
uniform int first_pixels, first_map_uvs, first_materials, first_tints;

// Number of 32-bit words of a record `Transmittance`, and offsets of its fields.
#define SURFACE_WORDS 20
#define SURFACE_BASE 0
#define SURFACE_THRESHOLD 3
#define SURFACE_FACTOR 4
#define SURFACE_CHANNELS 7
#define SURFACE_FIRST 8
#define SURFACE_WIDTH 9
#define SURFACE_HEIGHT 10
#define SURFACE_EXTENSION 11
#define SURFACE_NEAREST 12
#define SURFACE_FIRST_CORNER 13
#define SURFACE_IOR 14
#define SURFACE_SHARE 15
#define SURFACE_FACES 16
#define SURFACE_BODY 17

float transmission_float(const int i) { return uintBitsToFloat(transmission_tables[i]); }
int transmission_int(const int i) { return int(transmission_tables[i]); }
vec2 map_uv(const int corner)
{
    return vec2(transmission_float(first_map_uvs + 2 * corner), transmission_float(first_map_uvs + 2 * corner + 1));
}
vec3 tint_at(const int index)
{
    int i = first_tints + 4 * index;
    return vec3(transmission_float(i), transmission_float(i + 1), transmission_float(i + 2));
}
float pixel_value(const int index)
{
    uint word = transmission_tables[first_pixels + (index >> 1)];
    return float((word >> (16 * (index & 1))) & 0xffffu) / 65535.0;
}

Fraction map_pixel(const int x, const int y, const int surface)
{
    int width = transmission_int(surface + SURFACE_WIDTH), height = transmission_int(surface + SURFACE_HEIGHT);
    int extension = transmission_int(surface + SURFACE_EXTENSION);
    if (extension == 3 && (x < 0 || y < 0 || x >= width || y >= height))
        return Fraction(0.0);
    int pixel = wrapped(y, height, extension) * width + wrapped(x, width, extension);
    int channels = transmission_int(surface + SURFACE_CHANNELS);
    int first = transmission_int(surface + SURFACE_FIRST) + channels * pixel;
#ifdef TINTED
    if (channels > 1)
        return vec3(pixel_value(first), pixel_value(first + 1), pixel_value(first + 2));
#endif
    return Fraction(pixel_value(first));
}

Fraction map_value(const vec2 uv, const int surface)
{
    vec2 size = vec2(transmission_int(surface + SURFACE_WIDTH), transmission_int(surface + SURFACE_HEIGHT));
    vec2 pixel = near_image(uv, transmission_int(surface + SURFACE_EXTENSION)) * size;
    // All four pixels are read at one place of the code, because drivers inline every call.
    bool nearest = transmission_int(surface + SURFACE_NEAREST) != 0;
    vec2 low = nearest ? floor(pixel) : floor(pixel - 0.5), f = nearest ? vec2(0.0) : pixel - 0.5 - low;
    Fraction sum = Fraction(0.0);
    for (int i = 0; i < (nearest ? 1 : 4); ++i) {
        vec2 weights = mix(1.0 - f, f, vec2(i & 1, i >> 1));
        sum += weights.x * weights.y * map_pixel(int(low.x) + (i & 1), int(low.y) + (i >> 1), surface);
    }
    return sum;
}

Fraction of_channels(const int first)
{
#ifdef TINTED
    return vec3(transmission_float(first), transmission_float(first + 1), transmission_float(first + 2));
#else
    return transmission_float(first);
#endif
}

// Returns the opacity of a surface at a point of a triangle. w: barycentrics of the second and third corner. kind:
// SHADOW or BOUNCE. cosine: of the angle of incidence, for ANGULAR.
Fraction opacity(const int triangle, const vec2 w, const bool front, const int kind, const float cosine)
{
    int material = transmission_int(first_materials + triangle);
    int surface = SURFACE_WORDS * (4 * material + (front ? kind : BACK_SIDE + kind));
    Fraction stopped = of_channels(surface + SURFACE_BASE);
    if (transmission_int(surface + SURFACE_WIDTH) > 0) {
        int corner = transmission_int(surface + SURFACE_FIRST_CORNER) + 3 * triangle;
        vec2 uv = map_uv(corner) * (1.0 - w.x - w.y) + map_uv(corner + 1) * w.x + map_uv(corner + 2) * w.y;
        stopped += of_channels(surface + SURFACE_FACTOR) * map_value(uv, surface);
    }
    float threshold = transmission_float(surface + SURFACE_THRESHOLD);
    if (threshold >= 0.0)
        return step(Fraction(threshold), stopped);
    stopped = clamp(stopped, 0.0, 1.0);
#ifdef ANGULAR
    vec4 fresnel = vec4(transmission_float(surface + SURFACE_IOR), transmission_float(surface + SURFACE_SHARE),
                        transmission_float(surface + SURFACE_FACES), transmission_float(surface + SURFACE_BODY));
    stopped = at_angle(stopped, fresnel, cosine);
#endif
    return stopped;
}

// Returns the smallest opacity that stops a ray at this hit. With DITHERED it is a pseudo-random number from a hash of
// the hit point, so that partial opacity stops that fraction of all rays. Without, it is 1/2.
float least_opacity(const Hit hit)
{
#ifdef DITHERED
    uint seed = floatBitsToUint(hit.weights.x) * 0x9e3779b9u ^ floatBitsToUint(hit.weights.y) * 0x85ebca6bu
        ^ uint(hit.triangle);
    seed = (seed ^ (seed >> 16)) * 0x7feb352du;
    seed = (seed ^ (seed >> 15)) * 0x846ca68bu;
    return float((seed >> 8) + 1u) * (1.0 / 16777216.0);
#else
    return 0.5;
#endif
}
#endif

// Search modes of a traversal: product of transmittances up to a distance (ALL), nearest opaque hit, nearest opaque
// back-face hit, or tint of the surfaces passed.
#define ALL 0
#define NEAREST_SURFACE 1
#define NEAREST_BACK 2
#define TINTS 4

// Maximum ray length, beyond all surfaces; not infinite.
#define FARTHEST 1e38

// Relative distance added to back-face hits, so that a coplanar front face wins.
#define BACK_FARTHER 1e-5

struct Search {
    vec3 origin, direction, inverse;
    int sought, kind;  // kind: SHADOW or BOUNCE
    float reach;       // maximum distance, in lengths of the direction
    Fraction through;  // transmittance so far
    Hit nearest;
    bool tinted;       // true if the ray has passed a tinted surface
};

// Slab test (Kay and Kajiya 1986): returns true if a ray hits a box, and in `begin` the distance at which it enters.
// Boxes are enlarged for rounding (Ize 2013). The inverse direction is finite, so no value is NaN.
bool meets_box(const Search search, const vec3 low, const vec3 high, out float begin)
{
    vec3 a = (low - search.origin) * search.inverse, b = (high - search.origin) * search.inverse;
    bvec3 backward = lessThan(search.inverse, vec3(0.0));
    vec3 enter = mix(a, b, backward), leave = mix(b, a, backward);
    begin = max(max(enter.x, enter.y), max(enter.z, 0.0));
    return begin <= min(min(leave.x, leave.y), min(leave.z, search.reach)) * 1.0000004;
}

// Merges the hit of a triangle into the search; returns false once the search is complete. Ray-triangle intersection by
// Moeller and Trumbore 1997. Triangles are enlarged slightly, so that rays cannot slip between neighbours.
bool take_triangle(const int index, inout Search search)
{
    uvec4 record = triangle_records[3 * index];
    vec3 corner = uintBitsToFloat(record.xyz);
    vec3 edge1 = uintBitsToFloat(triangle_records[3 * index + 1].xyz);
    vec3 edge2 = uintBitsToFloat(triangle_records[3 * index + 2].xyz);
    vec3 d = search.direction, s = search.origin - corner;
    vec3 p = cross(d, edge2), q = cross(s, edge1);
    float determinant = dot(edge1, p), inverse = 1.0 / determinant;
    float u = dot(s, p) * inverse, v = dot(d, q) * inverse, distance = dot(edge2, q) * inverse;
    const float rim = 1e-6;
    if (!(determinant != 0.0 && u >= -rim && v >= -rim && u + v <= 1.0 + rim && distance > 0.0
          && distance < search.reach))
        return true;
    bool front = determinant > 0.0;
    if (search.sought == NEAREST_BACK && front)
        return true;
    if (!front && (search.sought == NEAREST_SURFACE || search.sought == TINTS))
        distance += BACK_FARTHER * distance;
    if (!(distance < search.reach))
        return true;
    Hit hit = Hit(distance, vec2(u, v), int(record.w), front, false);
#ifdef TRANSMISSION
#ifdef ANGULAR
    float cosine = min(abs(determinant) / (length(cross(edge1, edge2)) * length(d)), 1.0);
#else
    const float cosine = 1.0;
#endif
    Fraction stopped = opacity(hit.triangle, hit.weights, front, search.kind, cosine);
    float least = least_opacity(hit);
#else
    Fraction stopped = Fraction(1.0);
    const float least = 0.5;
#endif
    if (search.sought == ALL) {
        search.through *= 1.0 - stopped;
        return largest(search.through) >= 1e-4;
    }
#ifdef TINTED
    if (search.sought == TINTS) {
        Fraction passed = 1.0 - stopped;
        if (hit.triangle != search.nearest.triangle && largest(passed) > 0.0)
            search.through *= passed / largest(passed);
        return true;
    }
#endif
    if (smallest(stopped) >= least) {
        search.nearest = hit;
        search.reach = distance;
    }
#ifdef TINTED
    else if (largest(stopped) > smallest(stopped))
        search.tinted = true;
#endif
    return true;
}

// Tests all triangles of a leaf; returns false once the search is complete.
bool take_leaf(const int code, inout Search search)
{
    int first = code >> LEAF_BITS, count = code & ((1 << LEAF_BITS) - 1);
    for (int i = 0; i < count; ++i)
        if (!take_triangle(first + i, search))
            return false;
    return true;
}

// Number of traversal steps of this invocation so far. Mesa's llvmpipe ends loops after 65,535 steps in total, so
// shaders that trace many rays pause (resumed.glsl).
int steps = 0;

// Traverses the BVH, near children first (while-while loop of Aila and Laine 2009).
void descend(inout Search search)
{
    int stack[STACK];
    int depth = 0, node = 0;
    for (;;) {
        while (node >= 0) {
            ++steps;
            uvec4 low1 = nodes[4 * node], high1 = nodes[4 * node + 1];
            uvec4 low2 = nodes[4 * node + 2], high2 = nodes[4 * node + 3];
            float begin1, begin2;
            bool first = meets_box(search, uintBitsToFloat(low1.xyz), uintBitsToFloat(high1.xyz), begin1);
            bool second = meets_box(search, uintBitsToFloat(low2.xyz), uintBitsToFloat(high2.xyz), begin2);
            int child1 = int(low1.w), child2 = int(low2.w);
            if (first && second) {
                bool far_first = begin2 < begin1;
                stack[depth++] = far_first ? child1 : child2;
                node = far_first ? child2 : child1;
            } else if (first || second) {
                node = first ? child1 : child2;
            } else {
                if (depth == 0)
                    return;
                node = stack[--depth];
            }
        }
        steps += 1 + LEAF_STEPS;
        if (!take_leaf(~node, search)) {
            search.through = Fraction(0.0);
            return;
        }
        if (depth == 0)
            return;
        node = stack[--depth];
    }
}

Search search_for(const int sought, const int kind, const vec3 origin, const vec3 direction, const float reach)
{
    Hit nothing = Hit(INFINITY, vec2(0.0), -1, false, false);
    return Search(origin, direction, clamp(1.0 / direction, -1e30, 1e30), sought, kind, reach, Fraction(1.0), nothing,
                  false);
}

// Returns the transmittance along a ray up to a distance: 1 if unoccluded, 0 if blocked. kind: SHADOW or BOUNCE,
// selects the transmittance of surfaces.
Fraction transmittance(const int kind, const vec3 origin, const vec3 direction, const float distance)
{
    Search search = search_for(ALL, kind, origin, direction, distance);
    descend(search);
    return search.through;
}

// Returns the nearest opaque hit along a ray, or the nearest opaque back-face hit if `backs`. Transparent points are
// passed.
Hit nearest_hit(const vec3 origin, const vec3 direction, const bool backs)
{
    Search search = search_for(backs ? NEAREST_BACK : NEAREST_SURFACE, BOUNCE, origin, direction, FARTHEST);
    descend(search);
    search.nearest.tinted = search.tinted;
    return search.nearest;
}

#ifdef TINTED
// Returns the tint, rgb, of light that arrives along a ray from a hit or the sky. The ray passed each transparent
// surface with a probability equal to the largest channel of its transmittance; the tint is the product of the
// remaining factors transmittance / largest channel.
vec3 tint_of_way(const vec3 origin, const vec3 direction, const Hit hit)
{
    Search search = search_for(TINTS, BOUNCE, origin, direction, min(hit.distance, FARTHEST));
    search.nearest.triangle = hit.triangle;
    descend(search);
    return search.through;
}
#endif
