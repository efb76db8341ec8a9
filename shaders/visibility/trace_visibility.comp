#version 430
// Traces visibility samples: finds which patch each hemisphere sample of a patch hits. One work item per ray; the
// samples of a patch are consecutive. The same algorithm as kernels/visibility/trace_visibility.cl, which also sums the
// light of back faces.
#define RECEIVER_ACCESS readonly
#define DITHERED
#include "bvh_traversal.glsl"
#include "receiver.glsl"
#include "texel_ray_origins.glsl"
#include "view_samples.glsl"
#include "visibility_sample.glsl"

layout(local_size_x = 64) in;
layout(std430, binding = 7) writeonly buffer Rows { uint rows[]; };
uniform int start, end, first_patch;
uniform int first_uvs, first_atlases, first_texel_to_patch, resolution, has_backs, first_backs;

// Number of distinct origins in a texel that a face crosses. Each costs rays of its own, so consecutive samples share
// one.
#define PLACES_IF_CROSSED 32

// Jitters the ray origin over the texel: a patch stores the mean irradiance of its texel.
vec3 origin_of(const View view, const Receiver r, const int i)
{
    int place = r.crossed ? i * PLACES_IF_CROSSED / samples : i;
    uvec2 shift = uvec2(hash(r.rank + view.shift.x), hash(r.rank + view.shift.y));
    return view.eye + jittered_origin(r, place_of_sample(place, shift)) - r.at;
}

#ifdef TINTED
// Returns the palette index of a tint. Tints that are not in the palette are dithered to a corner of their lattice
// cell, so that the mean is exact.
int index_of_tint(const vec3 tint, const uint key)
{
    int count = int(transmission_float(first_tints + 3));
    for (int i = 0; i < count; ++i) {
        vec3 off = abs(tint - tint_at(i));
        if (max(off.x, max(off.y, off.z)) < SAME_TINT)
            return i;
    }
    vec3 cell = clamp(tint, 0.0, 1.0) * float(LEVELS - 1);
    ivec3 low = ivec3(cell);
    vec3 lot = vec3(uvec3(hash(key), hash(key + 0x9e3779b9u), hash(key + 0x3c6ef372u)) >> 8) * (1.0 / 16777216.0);
    ivec3 corner = low + ivec3(lessThan(lot, cell - vec3(low)));
    return EXACT + corner.x + LEVELS * (corner.y + LEVELS * corner.z);
}
#endif

// Returns the visibility sample of a ray: the entry that it hits.
int entry_of(const Hit hit)
{
    if (hit.triangle < 0)
        return outside;
    // If back faces of this triangle have patches, the hit is replaced by a front-face hit of the twin triangle, whose
    // corners are in opposite order.
    int triangle = hit.triangle, back = -1;
    if (!hit.front && has_backs != 0)
        back = int(view_tables[first_backs + triangle]);
    bool front = hit.front || back >= 0;
    vec2 w = back >= 0 ? hit.weights.yx : hit.weights;
    triangle = back >= 0 ? back : triangle;
    int corner = first_uvs + 6 * triangle;
    vec2 uv = view_vec2(corner) * (1.0 - w.x - w.y) + view_vec2(corner + 2) * w.x + view_vec2(corner + 4) * w.y;
    ivec2 texel = clamp(ivec2(uv * float(resolution)), 0, resolution - 1);
    int row = int(view_tables[first_atlases + triangle]) * resolution + texel.y;
    int entry = int(view_tables[first_texel_to_patch + row * resolution + texel.x]);
    return front ? entry : outside + 1 + entry;
}

void main()
{
    int item = start + int(gl_GlobalInvocationID.x);
    if (item >= end)
        return;
    int i = item % samples;
    Receiver r = load_receiver(first_patch + item / samples);
    View view = view_of(r);
    vec3 direction = sample_direction(view, i);
    uint kept = 0u;
    if (dot(direction, view.horizon) > 0.0) {
        vec3 origin = origin_of(view, r, i);
        Hit hit = nearest_hit(origin, direction, false);
        kept = uint(entry_of(hit));
#ifdef TINTED
        if (hit.tinted && kept != 0u) {
            uvec3 way = floatBitsToUint(direction);
            uint key = hash(way.x ^ hash(way.y ^ hash(way.z ^ floatBitsToUint(origin.x))));
            kept |= uint(index_of_tint(tint_of_way(origin, direction, hit), key)) << ENTRY_BITS;
        }
#endif
    } else {
        kept = BELOW_HORIZON;
    }
    rows[item] = kept;
}
