#version 430
// Push-off: moves sample points inside geometry to the nearest outside. The same algorithm as
// kernels/validity/push_off.cl. Each point has two results. As floats: xyz the displacement, metres, 0 for none; w the
// thickness of the object around the point, metres. As integers: a triangle of the object, the two triangles between
// which thickness is measured, and the result of the test: INSIDE, ENCLOSED or 0.
#define RECEIVER_ACCESS readonly
#define STATE_WORDS 6
#include "bvh_traversal.glsl"
#include "resumed.glsl"
#include "receiver.glsl"
#include "validity.glsl"

layout(local_size_x = 64) in;
layout(std430, binding = 7) writeonly buffer Results { ivec4 results[]; };
uniform int start, end;
uniform float reach;

#define WAYS 8  // rays in the tangent plane; opposite rays measure the thickness of the object
#define MARGIN 0.05  // distance of moved points from the surface, in texels
#define INSIDE 1  // results of the test, as in engine/validity/push_off.py
#define ENCLOSED 2

// Returns how far a probe ray indicates the outside: 2 if it hits nothing, or a front face that is outside itself; 1 if
// it hits a lit back face at a distance; else 0.
int escape(const Hit hit, const vec3 at, const float height, const float near)
{
    if (hit.triangle < 0)
        return 2;
    if (!hit.front)
        return int(!meets_dark_back(hit, near));
    vec3 normal = normal_of(hit.triangle);
    return 2 * int(hits_few_backfaces(at + height * normal, normal, near, MAX_BACKS_OUTSIDE));
}

// State of the probe rays of a point. The first round counts dark back faces and all near faces, the second round all
// hits.
struct Progress {
    int next, backs, nears, escaped, fronts;
};

void exchange(inout Progress probes)
{
    exchange(probes.next);
    exchange(probes.backs);
    exchange(probes.nears);
    exchange(probes.escaped);
    exchange(probes.fronts);
}

// Returns true if the first round proves that a point is outside; see kernels/validity/push_off.cl.
bool is_clearly_outside(const Progress probes)
{
    return probes.backs == 0 && probes.nears < FIRST_PROBES;
}

// Continues with the probe rays of a point; returns true once the result is certain.
bool probe_on(const Receiver r, const vec3 origin, const vec3 x, const vec3 y, inout Progress probes)
{
    float near = LIT_FROM * reach * r.size;
    for (; probes.next < FIRST_PROBES + LOOKS; ++probes.next) {
        if (probes.escaped > MAX_ESCAPES && probes.fronts > MAX_BACKS_OUTSIDE)
            return true;
        if (probes.next == FIRST_PROBES && is_clearly_outside(probes))
            return true;
        if (steps > MAX_STEPS)
            return false;
        bool first = probes.next < FIRST_PROBES;
        vec3 direction = probe_direction(first ? probes.next : probes.next - FIRST_PROBES, x, y, r.geometric);
        Hit hit = nearest_hit(origin, direction, false);
        bool dark = meets_dark_back(hit, near);
        if (first) {
            probes.backs += int(dark);
            probes.nears += int(hit.triangle >= 0 && hit.distance <= near);
            continue;
        }
        probes.fronts += int(hit.triangle < 0 || hit.front);
        if (probes.escaped <= MAX_ESCAPES)
            probes.escaped += escape(hit, origin + hit.distance * direction, r.height, near);
    }
    return true;
}

void main()
{
    int point = start + int(gl_GlobalInvocationID.x);
    if (point >= end)
        return;
    Receiver r = load_receiver(point);
    vec3 origin = r.at + r.height * r.geometric, x, y, way = vec3(0.0);
    basis(r.geometric, x, y);
    Progress probes = Progress(0, 0, 0, 0, 0);
    int slot = point - start;
    uint state = begin_state(slot, false);
    if (state == 2u)
        return;
    if (state == 1u)
        exchange(probes);
    bool done = probe_on(r, origin, x, y, probes);
    begin_state(slot, true);
    exchange(probes);
    end_state(slot, done);
    if (!done)
        return;
    bool inside = !is_clearly_outside(probes) && probes.escaped <= MAX_ESCAPES, backs_only = probes.fronts == 0;
    bool enclosed = !is_clearly_outside(probes) && probes.fronts <= MAX_BACKS_OUTSIDE;
    int tested = inside ? INSIDE : enclosed ? ENCLOSED : 0;
    float nearest = INFINITY, thickness = INFINITY, distances[WAYS];
    int met[WAYS], wall = -1;
    ivec2 sides = ivec2(-1);
    for (int i = 0; i < (inside ? WAYS : 0); ++i) {
        float angle = 2.0 * float(PI) * float(i) / float(WAYS);
        vec3 direction = cos(angle) * x + sin(angle) * y;
        Hit hit = nearest_hit(origin, reach * r.size * direction, false);
        distances[i] = is_back(hit) && hit.distance <= 1.0 ? hit.distance * reach * r.size : INFINITY;
        met[i] = hit.triangle;
        if (distances[i] < nearest) {
            nearest = distances[i];
            wall = hit.triangle;
            if (backs_only)
                way = (nearest + MARGIN * r.size + r.height) * direction;
        }
        if (i >= WAYS / 2 && distances[i] + distances[i - WAYS / 2] < thickness) {
            thickness = distances[i] + distances[i - WAYS / 2];
            sides = ivec2(met[i], met[i - WAYS / 2]);
        }
    }
    results[2 * point] = floatBitsToInt(vec4(way, thickness));
    results[2 * point + 1] = ivec4(wall, sides, tested);
}
