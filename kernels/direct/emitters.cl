#pragma once
#include "receiver.cl"
#include "modulation.cl"

// Emitters of direct light: samples on lights, emissive triangles and bright sky, and estimates of their irradiance for
// light selection.

// Kinds of emitters (engine/direct/emitters.py).
#define POINT 0
#define SUN 1
#define TRIANGLE 2
#define SKY_MAP 3

// Solid angle above which triangles are sampled by solid angle instead of by area, sr. Area sampling takes half the
// time. For uniform triangles samples estimate only visibility, so the limit is higher.
#define WIDE 0.1f
#define WIDE_UNEVEN 0.01f

// Minimum squared distance, avoids division by zero.
#define LEAST 1e-36f

// SPHERE: the receiver is a point in space (a probe), which takes light from all directions without a cosine.
#ifdef SPHERE
#define IS_FACING(height, limit) true
#define COSINE(cosine, least) 1.0f
#else
#define IS_FACING(height, limit) ((height) > (limit))
#define COSINE(cosine, least) fmax(cosine, least)
#endif

float unit_float(const uint bits) { return (bits >> 8) * (1.0f / 16777216.0f); }

uint reversed_bits(uint x)
{
    x = (x << 16) | (x >> 16);
    x = ((x & 0x00ff00ffu) << 8) | ((x >> 8) & 0x00ff00ffu);
    x = ((x & 0x0f0f0f0fu) << 4) | ((x >> 4) & 0x0f0f0f0fu);
    x = ((x & 0x33333333u) << 2) | ((x >> 2) & 0x33333333u);
    return ((x & 0x55555555u) << 1) | ((x >> 1) & 0x55555555u);
}

// Returns sample i of two 2D low-discrepancy sequences, randomly shifted per patch (Cranley-Patterson rotation): R2
// (Roberts 2018) in xy, van der Corput and golden ratio in zw.
float4 sample_point(const uint index, const uint seed)
{
    const uint4 shift =
        (uint4)(hash(seed), hash(seed + 0x9e3779b9u), hash(seed + 0x3c6ef372u), hash(seed + 0xdaa66d2bu));
    const uint i = index + 1u;
    const uint4 point = (uint4)(i * 3242174889u, i * 2447445414u, reversed_bits(i), i * 2654435769u);
    return convert_float4((point + shift) >> 8) * (1.0f / 16777216.0f);
}

float luminance(const float3 colour) { return dot(colour, (float3)(0.2126f, 0.7152f, 0.0722f)); }

// Light sample: direction and distance from the receiver, and E/pi without shadow.
typedef struct {
    float3 direction;
    float distance;
    float3 light;
    bool back;  // True if it is on a back face
#ifdef TRANSMISSION
    int surface;  // emissive triangle + 1, or 0 for lights and sky
    bool shines_front;
    float steepness;  // cosine of the angle at which light leaves the surface
    float2 weights;
#endif
} Sample;

// Returns the fraction of a spot light's intensity in a direction away from it. The cone is circular in the light's own
// space, which may be scaled non-uniformly (Cycles, kernel/light/spot.h).
float in_cone(__global const Emitter *e, const float3 away, const float cos_half, const float blend)
{
    const float3 own = (float3)(dot(away, vload3(0, e->cone_x)), dot(away, vload3(0, e->cone_y)),
                                dot(away, vload3(0, e->direction)) * e->cone_z);
    const float s = (own.z / fmax(length(own), 1e-20f) - cos_half) / fmax((1.0f - cos_half) * blend, 1e-6f);
    const float t = clamp(s, 0.0f, 1.0f);
    return t * t * (3.0f - 2.0f * t);
}

// Samples a spherical light whose inside contains the receiver: constant radiance from all directions,
// cosine-distributed, also for spots (Cycles, kernel/light/spot.h). With SPHERE the directions are uniform.
Sample sample_around(__global const Emitter *e, const float3 centre, const float3 up, const float2 u)
{
#ifdef SPHERE
    const float z = 1.0f - 2.0f * u.x, sine = sqrt(fmax(1.0f - z * z, 0.0f)), cosine = 0.25f;
    const float3 direction = (float3)(sine * cospi(2.0f * u.y), sine * sinpi(2.0f * u.y), z);
#else
    float3 x, y;
    basis(up, &x, &y);
    const float2 q = disk(u);
    const float cosine = sqrt(fmax(1.0f - dot(q, q), 0.0f));
    const float3 direction = q.x * x + q.y * y + cosine * up;
#endif
    const float radius = e->radius, along = dot(direction, centre);
    const float rest = fmax(radius * radius - dot(centre, centre) + along * along, 0.0f);
    const Sample s = {direction, along + sqrt(rest), vload3(0, e->strength) / (radius * radius * fmax(cosine, 1e-6f))};
    return s;
}

// Samples a point or spot light: a disk facing the receiver (soft falloff), a sphere, or a point.
Sample sample_point_light(__global const Emitter *e, const float3 p, const float3 up, const float2 u)
{
    const float3 centre = vload3(0, e->position) - p;
    const float radius = e->radius, d2 = dot(centre, centre), d = sqrt(d2);
    if (!e->soft && d < radius)
        return sample_around(e, centre, up, u);
    Sample s = {centre / fmax(d, 1e-20f), d, (float3)(0.0f)};
    float weight = 1.0f / fmax(d2, 1e-20f);
    if (radius > 0.0f && e->soft) {
        float3 x, y;
        basis(s.direction, &x, &y);
        const float2 q = radius * disk(u);
        const float3 target = centre + q.x * x + q.y * y;
        s.distance = length(target);
        const float3 direction = target / s.distance;
        weight = dot(direction, s.direction) / (s.distance * s.distance);
        s.direction = direction;
    } else if (radius > 0.0f) {
        const float sin2 = fmin(radius * radius / fmax(d2, 1e-20f), 1.0f);
        const float one_minus_cos = sin2 / (1.0f + sqrt(1.0f - sin2));
        const float drop = u.x * one_minus_cos, cosine = 1.0f - drop, sine = sqrt(fmax(drop * (2.0f - drop), 0.0f));
        float3 x, y;
        basis(s.direction, &x, &y);
        const float3 axis = s.direction;
        s.direction = cosine * axis + sine * (cospi(2.0f * u.y) * x + sinpi(2.0f * u.y) * y);
        s.distance = d * cosine - sqrt(fmax(radius * radius - d2 * sine * sine, 0.0f));
        weight = 2.0f * one_minus_cos / (radius * radius);
    }
    if (e->cos_half_angle >= -1.0f)
        weight *= in_cone(e, -s.direction, e->cos_half_angle, e->blend);
    s.light = vload3(0, e->strength) * weight;
    return s;
}

// Samples a sun: a disk in the sky, uniform in solid angle projected along its axis.
Sample sample_sun(__global const Emitter *e, const float2 u)
{
    float3 x, y;
    const float3 axis = -vload3(0, e->direction);
    basis(axis, &x, &y);
    const float2 q = e->radius * disk(u);
    const float cosine = sqrt(fmax(1.0f - dot(q, q), 0.0f));
    const Sample s = {q.x * x + q.y * y + cosine * axis, INFINITY, vload3(0, e->strength) / fmax(cosine, 1e-6f)};
    return s;
}

// Returns a direction in a spherical triangle, uniform in solid angle (Arvo 1995). angle: its solid angle (Van Oosterom
// and Strackee 1983). Cross products of edges stay accurate for small triangles.
float3 in_spherical_triangle(const float3 a, const float3 b, const float3 c, const float2 u, float *angle)
{
    const float3 ab = b - a, ac = c - a;
    const float volume = fabs(dot(a, cross(ab, ac)));
    *angle = 2.0f * atan2(volume, 1.0f + dot(a, b) + dot(b, c) + dot(c, a));

    // The dihedral angle at corner a, from the normals of the two planes; their cross product has the length `volume`.
    const float along = dot(cross(a, ab), cross(a, ac));
    const float scale = rsqrt(fmax(along * along + volume * volume, 1e-36f));
    const float cos_alpha = scale * along, sin_alpha = scale * volume;
    const float turn = u.x * *angle * M_1_PI_F, sine = sinpi(turn), cosine = cospi(turn);
    const float s = sine * cos_alpha - cosine * sin_alpha, t = cosine * cos_alpha + sine * sin_alpha;

    // Move corner c along the edge from a to c, until the triangle a, b, c has the sampled fraction of its area.
    const float p = t - cos_alpha, v = s + sin_alpha * dot(a, b);
    const float bottom = (v * s + p * t) * sin_alpha;
    const float q = clamp(((v * t - p * s) * cos_alpha - v) / (fabs(bottom) < 1e-12f ? 1e-12f : bottom), -1.0f, 1.0f);
    const float3 third = normalize(c - dot(c, a) * a);
    const float3 end = q * a + sqrt(1.0f - q * q) * third;
    const float z = 1.0f - u.y * (1.0f - dot(end, b));
    return z * b + sqrt(fmax(1.0f - z * z, 0.0f)) * normalize(end - dot(end, b) * b);
}

// Returns a number in [0, 1] with linear density from a at 0 to b at 1. Multiplies `density` by it.
float linear_sample(const float u, const float a, const float b, float *density)
{
    const float x = fmin(u * (a + b) / (a + sqrt(mix(a * a, b * b, u))), 1.0f);
    *density *= 2.0f * mix(a, b, x) / (a + b);
    return x;
}

typedef struct {
    __global const float4 *radiance;       // of front faces, by patch + 1
    __global const float4 *back_radiance;  // of back faces
    __global const uint *texel_to_patch;   // patch + 1 of each texel of each lightmap, or 0
    __global const float2 *uvs;            // of each corner of each triangle
    int resolution;
} Glow;

// Returns true if the receiver is in front of a triangle and not in its plane. corner: relative to the receiver.
bool shows_front(const Receiver *r, const float3 corner, const float3 normal)
{
    return dot(normal, corner) < -r->height * length(normal);
}

// Returns true for a triangle of an area light that emits into a cone.
bool has_spread(__global const Emitter *e) { return e->kind == TRIANGLE && e->triangle < 0 && e->spread < 1.57f; }

// Samples an emissive triangle or a triangle of an area light: by solid angle if it is wide, else by area.
Sample sample_triangle(__global const Emitter *e, const Glow *glow, const Receiver *r, const float3 p, const float2 u)
{
    const float3 a = vload3(0, e->position) - p, edge1 = vload3(0, e->edge1), edge2 = vload3(0, e->edge2);
    const float3 normal = cross(edge1, edge2);
    const float twice = length(normal);
    const float3 middle = a + (edge1 + edge2) / 3.0f;
    const float size = fmax(dot(edge1, edge1), dot(edge2, edge2));
    Sample s = {(float3)(0.0f, 0.0f, 1.0f), 1.0f, (float3)(0.0f)};
    float2 w;
    float weight;
    const float wide = e->uniform ? WIDE : WIDE_UNEVEN;
    if (twice * 0.5f > wide * dot(middle, middle) || size > 0.25f * dot(middle, middle)) {
        const float3 first = normalize(a), second = normalize(a + edge1), third = normalize(a + edge2);

        // Warp the samples by the cosines of the corners, bilinearly interpolated (Hart et al. 2020).
        const float at_a = fmax(dot(first, r->normal), 0.01f), at_b = fmax(dot(second, r->normal), 0.01f);
        const float at_c = fmax(dot(third, r->normal), 0.01f);
        float density = 1.0f;
        const float y = linear_sample(u.y, at_b, 0.5f * (at_a + at_c), &density);
        const float x = linear_sample(u.x, mix(at_b, at_a, y), mix(at_b, at_c, y), &density);
        s.direction = in_spherical_triangle(first, second, third, (float2)(x, y), &weight);
        weight /= density;
        const float facing = dot(normal, s.direction);
        s.distance = dot(normal, a) / facing;
        if (!(weight > 0.0f && s.distance > 0.0f && s.distance < INFINITY))
            return s;
        const float3 q = s.distance * s.direction - a;
        w = (float2)(dot(cross(q, edge2), normal), dot(cross(edge1, q), normal)) / (twice * twice);
    } else {
        const float root = sqrt(u.x);
        w = (float2)(root * (1.0f - u.y), root * u.y);
        const float3 target = a + w.x * edge1 + w.y * edge2;
        s.distance = length(target);
        s.direction = target / s.distance;
        weight = 0.5f * fabs(dot(normal, s.direction)) / (s.distance * s.distance);
    }

    // Area lights emit from the front. Surfaces emit from both sides, with separate radiance.
    const float cosine = -dot(normal, s.direction) / twice;
    s.back = !shows_front(r, a, normal);
    float3 radiance;
    if (e->triangle < 0) {
        if (cosine <= 0.0f)
            return s;
        radiance = vload3(0, e->strength);
        if (has_spread(e)) {
            // Spread angle, the formula of Cycles' area lights (kernel/light/area.h).
            const float tangent = tan(e->spread);
            const float slope = sqrt(fmax(1.0f - cosine * cosine, 0.0f)) / fmax(cosine, 1e-6f);
            radiance *= fmax(tangent - slope, 0.0f) / (tangent - e->spread);
        }
    } else if (e->one_sided && cosine <= 0.0f) {
        return s;
    } else {
        __global const float2 *corner = glow->uvs + 3 * (size_t)e->triangle;
        const float2 uv = corner[0] * (1.0f - w.x - w.y) + corner[1] * w.x + corner[2] * w.y;
        const int page = e->atlas, limit = glow->resolution - 1;
        const int x = clamp((int)(uv.x * glow->resolution), 0, limit);
        const int y = clamp((int)(uv.y * glow->resolution), 0, limit);
        const size_t texel = ((size_t)page * glow->resolution + y) * glow->resolution + x;
        radiance = (cosine > 0.0f ? glow->radiance : glow->back_radiance)[glow->texel_to_patch[texel]].xyz;
#ifdef TRANSMISSION
        s.surface = e->triangle + 1;
        s.shines_front = cosine > 0.0f;
        s.steepness = fmin(fabs(cosine), 1.0f);
        s.weights = w;
#endif
    }
    s.light = radiance * weight * M_1_PI_F;
    return s;
}

typedef struct {
    __global const float4 *pixels;     // radiance
    __global const float *cumulative;  // distribution of luminance times solid angle, up to 1
    __global const int *listed;        // indices of the bright pixels
    int width, height, count;
    float total;
} Bright;

// Returns a point between -1 and 1 with the density of a tent, from a uniform number.
float tent(const float u) { return u < 0.5f ? sqrt(2.0f * u) - 1.0f : 1.0f - sqrt(2.0f - 2.0f * u); }

// Samples the bright part of the sky: pixels in proportion to luminance times solid angle, and around them the tents of
// bilinear interpolation, by which Blender shows images.
Sample sample_sky(const Bright *sky, const float2 u)
{
    int low = 0, high = sky->count - 1;
    while (low < high) {
        const int middle = (low + high) / 2;
        if (sky->cumulative[middle] > u.x)
            high = middle;
        else
            low = middle + 1;
    }
    const float before = low > 0 ? sky->cumulative[low - 1] : 0.0f;
    const float across = (u.x - before) / fmax(sky->cumulative[low] - before, 1e-20f);
    const int pixel = sky->listed[low], column = pixel % sky->width, row = pixel / sky->width;
    const float azimuth = 1.0f - 2.0f * (column + 0.5f + tent(clamp(across, 0.0f, 1.0f))) / sky->width;
    const float y = (row + 0.5f + tent(u.y)) / sky->height, z = -cospi(y), sine = fabs(sinpi(y));
    // The distribution has the mean sine over the pixel. A difference of cosines would cancel near the poles.
    const float half_pixel = sinpi(0.5f / sky->height);
    const float mean_sine = 2.0f * M_1_PI_F * sky->height * sinpi((row + 0.5f) / sky->height) * half_pixel;
    const float3 colour = sky->pixels[low].xyz;
    const Sample s = {(float3)(sine * cospi(azimuth), sine * sinpi(azimuth), z), INFINITY,
                      colour * (sky->total * M_1_PI_F * sine / (luminance(colour) * mean_sine))};
    return s;
}

// Not inlined, like `open_light` and `weight_of`: inlining at several places makes kernels large, which costs seconds
// to compile and is no faster (measured).
__attribute__((noinline)) Sample sample_emitter(__global const Emitter *e, const Glow *glow, const Bright *sky,
                                                const Modulations *modulations, const Receiver *r, const float3 p,
                                                const float2 u)
{
    const int kind = e->kind;
    Sample s = kind == POINT ? sample_point_light(e, p, r->normal, u)
        : kind == SUN        ? sample_sun(e, u)
        : kind == TRIANGLE   ? sample_triangle(e, glow, r, p, u)
                             : sample_sky(sky, u);
    if (e->modulation > 0)
        s.light *= modulation(modulations, e->modulation, -s.direction, s.distance);
    return s;
}

// Clips a convex polygon to the half-space in front of a plane through the origin (Sutherland and Hodgman 1974).
// Returns the number of corners, at most one more. A convex polygon crosses the plane twice. If it lies in the plane,
// rounding may cause more crossings; only the first two count.
int clip(const float3 *corners, const int count, const float3 normal, float3 *clipped)
{
    int kept = 0, changes = 0;
    float3 before = corners[count - 1];
    float height = dot(before, normal);
    bool front = height > 0.0f;
    for (int i = 0; i < count; ++i) {
        const float3 here = corners[i];
        const float now = dot(here, normal);
        if (changes < 2 && (now > 0.0f) != front) {
            clipped[kept++] = mix(before, here, height / (height - now));
            front = !front;
            ++changes;
        }
        if (front)
            clipped[kept++] = here;
        before = here;
        height = now;
    }
    return kept;
}

// Sums the edge terms of Lambert's formula for a triangle wholly above both horizons, three edges at once.
float form_factor(const float3 a, const float3 b, const float3 c, const float3 normal)
{
    const float3 ax = (float3)(a.x, b.x, c.x), ay = (float3)(a.y, b.y, c.y), az = (float3)(a.z, b.z, c.z);
    const float3 scale = 1.0f / sqrt(fmax(ax * ax + ay * ay + az * az, LEAST));
    const float3 x = ax * scale, y = ay * scale, z = az * scale;
    const float3 side_x = y * z.yzx - z * y.yzx, side_y = z * x.yzx - x * z.yzx, side_z = x * y.yzx - y * x.yzx;
    const float3 sine = sqrt(side_x * side_x + side_y * side_y + side_z * side_z);
    const float3 cosine = x * x.yzx + y * y.yzx + z * z.yzx;
    const float3 along = side_x * normal.x + side_y * normal.y + side_z * normal.z;
    const float3 parts = sine > 1e-12f ? atan2(sine, cosine) / sine * along : (float3)(0.0f);
    return parts.x + parts.y + parts.z;
}

// Returns the unoccluded irradiance (E/pi) at a point from a uniform triangle: the analytic form factor of the part
// above both horizons, of the smooth and the geometric normal (Lambert 1760; Arvo 1995).
__attribute__((noinline)) float3 open_light(__global const Emitter *e, const float3 p, const Receiver *r)
{
    const float3 a = vload3(0, e->position) - p, edge1 = vload3(0, e->edge1), edge2 = vload3(0, e->edge2);
    const float3 facing = cross(edge1, edge2);
    const bool front = dot(facing, a) < 0.0f;
    if (!front && (e->triangle < 0 || e->one_sided))
        return (float3)(0.0f);
    const float3 radiance = front ? vload3(0, e->strength) : vload3(0, e->back_strength);
    const float3 horizon = horizon_of(r, !shows_front(r, a, facing));
    const float3 b = a + edge1, c = a + edge2;
    const float lowest = fmin(fmin(fmin(dot(a, horizon), dot(b, horizon)), dot(c, horizon)),
                              fmin(fmin(dot(a, r->normal), dot(b, r->normal)), dot(c, r->normal)));
    if (lowest > 0.0f)
        return radiance * (fabs(form_factor(a, b, c, r->normal)) * 0.5f * M_1_PI_F);
    const float3 triangle[3] = {a, b, c};
    float3 above[4], corners[5];
    const int kept = clip(triangle, 3, horizon, above), count = kept > 2 ? clip(above, kept, r->normal, corners) : 0;
    if (count < 3)
        return (float3)(0.0f);
    float sum = 0.0f;
    float3 from = normalize(corners[count - 1]);
    for (int i = 0; i < count; ++i) {
        const float3 to = normalize(corners[i]), side = cross(from, to);
        const float sine = length(side);
        sum += sine > 1e-12f ? atan2(sine, dot(from, to)) / sine * dot(side, r->normal) : 0.0f;
        from = to;
    }
    return radiance * (fabs(sum) * 0.5f * M_1_PI_F);
}

// Returns true if the irradiance from a triangle hardly varies over a texel.
bool is_far(__global const Emitter *e, const Receiver *r)
{
    const float3 a = vload3(0, e->position) - r->at, edge1 = vload3(0, e->edge1), edge2 = vload3(0, e->edge2);
    const float3 middle = a + (edge1 + edge2) / 3.0f, normal = cross(edge1, edge2);
    const float radius = sqrt(fmax(dot(edge1, edge1), dot(edge2, edge2)));
    const float distance = fmax(fabs(dot(normal, a)) / fmax(length(normal), 1e-20f), length(middle) - radius);
    return r->size < 0.05f * distance;
}

// Lights nearer than this fraction of a texel's width are spread over the texel in estimates.
#define SPREAD 0.1f

// Estimates a point or spot light's luminous intensity in a direction. A fraction of the mean intensity is added, since
// the direction differs across the texel.
float own_strength(__global const Emitter *e, const Modulations *modulations, const float3 away, const float distance)
{
    if (e->modulation == 0)
        return e->luminance;
    const float3 factor = modulation(modulations, e->modulation, away, distance);
    return luminance(vload3(0, e->strength) * factor) + 0.05f * e->luminance;
}

// Estimates the unshadowed irradiance from an emitter, for light selection. Returns 0 only if it contributes none.
float emitter_weight(__global const Emitter *e, const Receiver *r, const Modulations *modulations,
                     const float sky_total)
{
    const int kind = e->kind;
    if (kind == SKY_MAP)
        return sky_total * M_1_PI_F;
    if (kind == SUN)
        return IS_FACING(dot(r->normal, -vload3(0, e->direction)), -e->radius) ? e->luminance : 0.0f;
    if (kind == POINT) {
        const float3 to = vload3(0, e->position) - r->at;
        const float d2 = dot(to, to), d = sqrt(d2), reach = e->radius + r->size;
#ifndef SPHERE
        if (dot(r->normal, to) < -reach || dot(r->horizon, to) < -reach)
            return 0.0f;
#endif

        // The spot's cone is widened by the angle that the texel spans.
        const float widest = e->cos_half_angle - 0.05f - r->size / fmax(d, 1e-20f);
        const float spot = e->cos_half_angle >= -1.0f && e->radius == 0.0f && widest > -1.0f
            ? in_cone(e, -to / fmax(d, 1e-20f), widest, 1.0f) + 1e-4f
            : 1.0f;
        const float cosine = d < reach ? 1.0f : COSINE(dot(r->normal, to) / fmax(d, 1e-20f), 0.05f);
        const float near = fmax(e->radius, SPREAD * r->size);
        const float towards = own_strength(e, modulations, -to / fmax(d, 1e-20f), d);
        return towards * spot * cosine / fmax(fmax(d2, near * near), LEAST);
    }
    const float3 edge1 = vload3(0, e->edge1), edge2 = vload3(0, e->edge2), normal = cross(edge1, edge2);
    const float3 a = vload3(0, e->position) - r->at, b = a + edge1, c = a + edge2;
    const float3 horizon = horizon_of(r, !shows_front(r, a, normal));
    const float top = fmax(fmax(dot(a, horizon), dot(b, horizon)), dot(c, horizon));
#ifndef SPHERE
    if (top <= fmax(1e-5f * length(a), r->height))
        return 0.0f;
#endif
    const float facing = -dot(normal, a), twice = length(normal);
    if ((e->triangle < 0 || e->one_sided) && facing <= -r->size * twice)
        return 0.0f;
    const float3 middle = (a + b + c) / 3.0f;
    const float d2 = dot(middle, middle), d = sqrt(d2);
    const float angle = fmin(0.5f * twice * fmax(fabs(facing) / (twice * d), 0.02f) / d2, 6.2831853f);
    const float about = e->luminance * angle * COSINE(dot(middle, r->normal) / d, 0.1f);
#ifdef SPHERE
    return about;
#else
    if (!e->uniform)
        return about;

    // Uniform radiance: the analytic irradiance, with a lower bound for light that reaches only other points of the
    // texel.
    return fmax(luminance(open_light(e, r->at, r)), 0.02f * about);
#endif
}
