#pragma once
#include "receiver.glsl"

// Sample patterns over the hemisphere of a patch: viewpoint, cosine-distributed directions, and weights. The same as
// kernels/visibility/view_samples.cl with COSINE.

// Tables of the samples, see engine/gather/shader_gather.py.
layout(std430, binding = 4) readonly buffer ViewTables { uint view_tables[]; };
uniform int first_pattern, samples, rotate;
uniform uint salt;

float view_float(const int i) { return uintBitsToFloat(view_tables[i]); }
vec2 view_vec2(const int i) { return vec2(view_float(i), view_float(i + 1)); }
vec3 view_vec3(const int i) { return vec3(view_float(i), view_float(i + 1), view_float(i + 2)); }

struct View {
    vec3 eye, right, up, normal, horizon;
    uvec2 shift;
};

// Increments of the R2 low-discrepancy sequence as fractions of 2^32 (engine/visibility/views/directions.py).
#define R2 uvec2(3242174889u, 2447445414u)

// Returns the view of a patch. Each patch continues the sample sequence where its predecessor along the Hilbert curve
// ended (Ahmed and Wonka 2020).
View view_of(const Receiver r)
{
    vec3 x, y;
    basis(r.normal, x, y);
    uvec2 shift = r.rank * uint(samples) * R2 + uvec2(salt, hash(salt));
    return View(r.at + r.height * r.geometric, x, y, r.normal, r.geometric, rotate != 0 ? shift : uvec2(0u));
}

// Returns the world-space direction of sample i.
vec3 sample_direction(const View view, const int i)
{
    uvec2 point = uvec2(view_tables[first_pattern + 2 * i], view_tables[first_pattern + 2 * i + 1]);
    vec2 u = vec2((point + view.shift) >> 8) * (1.0 / 16777216.0), q = disk(u);
    return q.x * view.right + q.y * view.up + sqrt(1.0 - u.x) * view.normal;
}
