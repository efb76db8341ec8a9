#pragma once
#include "probe_rays.glsl"

// Validity tests: decide from a few probe rays if a point is inside geometry. The same algorithms as in
// kernels/validity/validity.cl; engine/validity/thresholds.py defines the thresholds.

// Normals of the triangles, and for each triangle 1 if its back face emits light.
layout(std430, binding = 6) readonly buffer ValidityTables { uint validity_tables[]; };
uniform int has_lit, first_normals, first_lit;

bool is_flagged(const int triangle) { return validity_tables[first_lit + triangle] != 0u; }

vec3 normal_of(const int triangle)
{
    int i = first_normals + 3 * triangle;
    return uintBitsToFloat(uvec3(validity_tables[i], validity_tables[i + 1], validity_tables[i + 2]));
}

bool is_back(const Hit hit) { return hit.triangle >= 0 && !hit.front; }

// Returns true if a hit of a ray of unit direction is a back face that is dark or nearer than `near`.
bool meets_dark_back(const Hit hit, const float near)
{
    return is_back(hit) && !(has_lit != 0 && is_flagged(hit.triangle) && hit.distance > near);
}

// Counts of a point's probe rays by their hit: dark back faces, everything else, and all flagged back faces.
struct Probes {
    int backs, others, lit;
};

// Traces the first `count` probe rays of a point. Stops as soon as one number exceeds that in `most`.
Probes probe(const vec3 origin, const vec3 normal, const float near, const int count, const Probes most)
{
    vec3 x, y;
    basis(normal, x, y);
    Probes probes = Probes(0, 0, 0);
    for (int i = 0; i < count && probes.backs <= most.backs && probes.others <= most.others && probes.lit <= most.lit;
         ++i) {
        Hit hit = nearest_hit(origin, probe_direction(i, x, y, normal), false);
        bool dark = meets_dark_back(hit, near);
        probes.backs += int(dark);
        probes.others += int(!dark);
        if (has_lit != 0 && is_back(hit) && is_flagged(hit.triangle))
            ++probes.lit;
    }
    return probes;
}

// Returns true if at most `most` of the LOOKS probe rays hit dark back faces. Stops as soon as the result is certain.
bool hits_few_backfaces(const vec3 origin, const vec3 normal, const float near, const int most)
{
    return probe(origin, normal, near, LOOKS, Probes(most, LOOKS - most - 1, LOOKS)).backs <= most;
}
