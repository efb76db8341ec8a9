#pragma once
#include "receiver.glsl"
#include "modulation.glsl"
#include "sample_points.glsl"

// Emitters of direct light: samples on lights, emissive triangles and bright sky, and estimates of their irradiance for
// light selection. The same algorithms as in kernels/direct/emitters.cl.

layout(std430, binding = 4) readonly buffer Emitters { Emitter emitters[]; };

// Buffer offsets of emissive surfaces: radiance of front and back faces of patches, map from texels to patches, UVs of
// corners. Offsets of bright sky: its pixels, their cumulative luminance, and their indices.
uniform int first_radiance, first_back_radiance, first_texel_to_patch, first_uvs, resolution;
uniform int first_sky_pixels, first_cumulative, first_listed, sky_width, sky_height, sky_count;
uniform float sky_total;

// Kinds of emitters (engine/direct/emitters.py).
#define POINT 0
#define SUN 1
#define TRIANGLE 2
#define SKY_MAP 3

// Solid angle above which triangles are sampled by solid angle instead of by area, sr.
#define WIDE 0.1
#define WIDE_UNEVEN 0.01

// Minimum squared distance, avoids division by zero.
#define LEAST 1e-36

float luminance(const vec3 colour) { return dot(colour, vec3(0.2126, 0.7152, 0.0722)); }

// Light sample: direction and distance from the receiver, and E/pi without shadow.
struct Sample {
    vec3 direction;
    float distance;
    vec3 light;
    bool back;         // true if the sample is on a back face
    int surface;       // triangle + 1 of an emissive surface; 0 for other light
    bool shines_front; // true if its front face emits
    float steepness;   // cosine of the angle at which light leaves the surface
    vec2 weights;      // barycentrics of the second and third corner
};

Sample sample_of(const vec3 direction, const float distance, const vec3 light)
{
    return Sample(direction, distance, light, false, 0, false, 1.0, vec2(0.0));
}

vec3 strength_of(const int e) { return TO_VEC3(emitters[e].strength); }

// Returns the fraction of a spot light's intensity in a direction away from it. The cone is circular in the light's own
// space, which may be scaled non-uniformly (Cycles, kernel/light/spot.h).
float in_cone(const int e, const vec3 away, const float cos_half, const float blend)
{
    vec3 own = vec3(dot(away, TO_VEC3(emitters[e].cone_x)), dot(away, TO_VEC3(emitters[e].cone_y)),
                    dot(away, TO_VEC3(emitters[e].direction)) * emitters[e].cone_z);
    float s = (own.z / max(length(own), 1e-20) - cos_half) / max((1.0 - cos_half) * blend, 1e-6);
    float t = clamp(s, 0.0, 1.0);
    return t * t * (3.0 - 2.0 * t);
}

// Samples a spherical light whose inside contains the receiver: constant radiance from all directions,
// cosine-distributed, also for spots (Cycles, kernel/light/spot.h).
Sample sample_around(const int e, const vec3 centre, const vec3 up, const vec2 u)
{
    vec3 x, y;
    basis(up, x, y);
    vec2 q = disk(u);
    float cosine = sqrt(max(1.0 - dot(q, q), 0.0));
    vec3 direction = q.x * x + q.y * y + cosine * up;
    float radius = emitters[e].radius, along = dot(direction, centre);
    float rest = max(radius * radius - dot(centre, centre) + along * along, 0.0);
    return sample_of(direction, along + sqrt(rest), strength_of(e) / (radius * radius * max(cosine, 1e-6)));
}

// Samples a point or spot light: a disk facing the receiver (soft falloff), a sphere, or a point.
Sample sample_point_light(const int e, const vec3 p, const vec3 up, const vec2 u)
{
    vec3 centre = TO_VEC3(emitters[e].position) - p;
    float radius = emitters[e].radius, d2 = dot(centre, centre), d = sqrt(d2);
    bool soft = emitters[e].soft != 0;
    if (!soft && d < radius)
        return sample_around(e, centre, up, u);
    Sample s = sample_of(centre / max(d, 1e-20), d, vec3(0.0));
    float weight = 1.0 / max(d2, 1e-20);
    if (radius > 0.0 && soft) {
        vec3 x, y;
        basis(s.direction, x, y);
        vec2 q = radius * disk(u);
        vec3 target = centre + q.x * x + q.y * y;
        s.distance = length(target);
        vec3 direction = target / s.distance;
        weight = dot(direction, s.direction) / (s.distance * s.distance);
        s.direction = direction;
    } else if (radius > 0.0) {
        float sin2 = min(radius * radius / max(d2, 1e-20), 1.0);
        float one_minus_cos = sin2 / (1.0 + sqrt(1.0 - sin2));
        float drop = u.x * one_minus_cos, cosine = 1.0 - drop, sine = sqrt(max(drop * (2.0 - drop), 0.0));
        vec3 x, y;
        basis(s.direction, x, y);
        vec3 axis = s.direction;
        float turn = 2.0 * float(PI) * u.y;
        s.direction = cosine * axis + sine * (cos(turn) * x + sin(turn) * y);
        s.distance = d * cosine - sqrt(max(radius * radius - d2 * sine * sine, 0.0));
        weight = 2.0 * one_minus_cos / (radius * radius);
    }
    if (emitters[e].cos_half_angle >= -1.0)
        weight *= in_cone(e, -s.direction, emitters[e].cos_half_angle, emitters[e].blend);
    s.light = strength_of(e) * weight;
    return s;
}

// Samples a sun: a disk in the sky, uniform in solid angle projected along its axis.
Sample sample_sun(const int e, const vec2 u)
{
    vec3 x, y, axis = -TO_VEC3(emitters[e].direction);
    basis(axis, x, y);
    vec2 q = emitters[e].radius * disk(u);
    float cosine = sqrt(max(1.0 - dot(q, q), 0.0));
    return sample_of(q.x * x + q.y * y + cosine * axis, INFINITY, strength_of(e) / max(cosine, 1e-6));
}

// Returns a direction in a spherical triangle, uniform in solid angle (Arvo 1995). angle: its solid angle (Van Oosterom
// and Strackee 1983). Cross products of edges stay accurate for small triangles.
vec3 in_spherical_triangle(const vec3 a, const vec3 b, const vec3 c, const vec2 u, out float angle)
{
    vec3 ab = b - a, ac = c - a;
    float volume = abs(dot(a, cross(ab, ac)));
    angle = 2.0 * atan(volume, 1.0 + dot(a, b) + dot(b, c) + dot(c, a));

    // The dihedral angle at corner a, from the normals of the two planes; their cross product has the length `volume`.
    float along = dot(cross(a, ab), cross(a, ac));
    float scale = inversesqrt(max(along * along + volume * volume, 1e-36));
    float cos_alpha = scale * along, sin_alpha = scale * volume;
    float turn = u.x * angle, sine = sin(turn), cosine = cos(turn);
    float s = sine * cos_alpha - cosine * sin_alpha, t = cosine * cos_alpha + sine * sin_alpha;

    // Move corner c along its edge until the partial triangle has the sampled fraction of the area.
    float p = t - cos_alpha, v = s + sin_alpha * dot(a, b);
    float bottom = (v * s + p * t) * sin_alpha;
    float q = clamp(((v * t - p * s) * cos_alpha - v) / (abs(bottom) < 1e-12 ? 1e-12 : bottom), -1.0, 1.0);
    vec3 third = normalize(c - dot(c, a) * a);
    vec3 end_ = q * a + sqrt(1.0 - q * q) * third;
    float z = 1.0 - u.y * (1.0 - dot(end_, b));
    return z * b + sqrt(max(1.0 - z * z, 0.0)) * normalize(end_ - dot(end_, b) * b);
}

// Returns a number in [0, 1] with linear density from a at 0 to b at 1. Multiplies `density` by it.
float linear_sample(const float u, const float a, const float b, inout float density)
{
    float x = min(u * (a + b) / (a + sqrt(mix(a * a, b * b, u))), 1.0);
    density *= 2.0 * mix(a, b, x) / (a + b);
    return x;
}

// Returns true if the receiver is in front of a triangle and not in its plane. corner: relative to the receiver.
bool shows_front(const Receiver r, const vec3 corner, const vec3 normal)
{
    return dot(normal, corner) < -r.height * length(normal);
}

// Returns the radiance of one side of an emissive triangle at a point. w: barycentrics of the second and third corner.
vec3 glow_at(const int e, const vec2 w, const bool front)
{
    int corner = first_uvs + 6 * emitters[e].triangle;
    vec2 uv = vec2(table_float(corner), table_float(corner + 1)) * (1.0 - w.x - w.y)
        + vec2(table_float(corner + 2), table_float(corner + 3)) * w.x
        + vec2(table_float(corner + 4), table_float(corner + 5)) * w.y;
    ivec2 at = clamp(ivec2(uv * float(resolution)), 0, resolution - 1);
    int texel = (emitters[e].atlas * resolution + at.y) * resolution + at.x;
    int entry = int(light_tables[first_texel_to_patch + texel]);
    return table_vec3((front ? first_radiance : first_back_radiance) + 4 * entry);
}

// Returns true for a triangle of an area light that emits into a cone.
bool has_spread(const int e)
{
    return emitters[e].kind == TRIANGLE && emitters[e].triangle < 0 && emitters[e].spread < 1.57;
}

// Samples an emissive triangle or a triangle of an area light: by solid angle if it is wide, else by area.
Sample sample_triangle(const int e, const Receiver r, const vec3 p, const vec2 u)
{
    vec3 a = TO_VEC3(emitters[e].position) - p, edge1 = TO_VEC3(emitters[e].edge1), edge2 = TO_VEC3(emitters[e].edge2);
    vec3 normal = cross(edge1, edge2);
    float twice = length(normal);
    vec3 middle = a + (edge1 + edge2) / 3.0;
    float size = max(dot(edge1, edge1), dot(edge2, edge2));
    Sample s = sample_of(vec3(0.0, 0.0, 1.0), 1.0, vec3(0.0));
    vec2 w;
    float weight;
    float wide = emitters[e].uniform_ != 0 ? WIDE : WIDE_UNEVEN;
    if (twice * 0.5 > wide * dot(middle, middle) || size > 0.25 * dot(middle, middle)) {
        vec3 first = normalize(a), second = normalize(a + edge1), third = normalize(a + edge2);

        // Warp the samples by the cosines of the corners, bilinearly interpolated (Hart et al. 2020).
        float at_a = max(dot(first, r.normal), 0.01), at_b = max(dot(second, r.normal), 0.01);
        float at_c = max(dot(third, r.normal), 0.01);
        float density = 1.0;
        float y = linear_sample(u.y, at_b, 0.5 * (at_a + at_c), density);
        float x = linear_sample(u.x, mix(at_b, at_a, y), mix(at_b, at_c, y), density);
        s.direction = in_spherical_triangle(first, second, third, vec2(x, y), weight);
        weight /= density;
        float facing = dot(normal, s.direction);
        s.distance = dot(normal, a) / facing;
        if (!(weight > 0.0 && s.distance > 0.0 && s.distance < INFINITY))
            return s;
        vec3 q = s.distance * s.direction - a;
        w = vec2(dot(cross(q, edge2), normal), dot(cross(edge1, q), normal)) / (twice * twice);
    } else {
        float root = sqrt(u.x);
        w = vec2(root * (1.0 - u.y), root * u.y);
        vec3 target = a + w.x * edge1 + w.y * edge2;
        s.distance = length(target);
        s.direction = target / s.distance;
        weight = 0.5 * abs(dot(normal, s.direction)) / (s.distance * s.distance);
    }

    // Area lights emit from the front. Surfaces emit from both sides, with separate radiance.
    float cosine = -dot(normal, s.direction) / twice;
    s.back = !shows_front(r, a, normal);
    vec3 radiance;
    if (emitters[e].triangle < 0) {
        if (cosine <= 0.0)
            return s;
        radiance = strength_of(e);
        if (has_spread(e)) {
            // Spread angle, the formula of Cycles' area lights (kernel/light/area.h).
            float spread = emitters[e].spread, tangent = tan(spread);
            float slope = sqrt(max(1.0 - cosine * cosine, 0.0)) / max(cosine, 1e-6);
            radiance *= max(tangent - slope, 0.0) / (tangent - spread);
        }
    } else if (emitters[e].one_sided != 0 && cosine <= 0.0) {
        return s;
    } else {
        radiance = glow_at(e, w, cosine > 0.0);
        s.surface = emitters[e].triangle + 1;
        s.shines_front = cosine > 0.0;
        s.steepness = min(abs(cosine), 1.0);
        s.weights = w;
    }
    s.light = radiance * weight * INVERSE_PI;
    return s;
}

// Returns a point between -1 and 1 with the density of a tent, from a uniform number.
float tent(const float u) { return u < 0.5 ? sqrt(2.0 * u) - 1.0 : 1.0 - sqrt(2.0 - 2.0 * u); }

// Samples the bright part of the sky: pixels in proportion to luminance times solid angle, and around them the tents of
// bilinear interpolation, by which Blender shows images.
Sample sample_sky(const vec2 u)
{
    int low = 0, high = sky_count - 1;
    while (low < high) {
        int middle = (low + high) / 2;
        if (table_float(first_cumulative + middle) > u.x)
            high = middle;
        else
            low = middle + 1;
    }
    float before = low > 0 ? table_float(first_cumulative + low - 1) : 0.0;
    float across = (u.x - before) / max(table_float(first_cumulative + low) - before, 1e-20);
    int pixel = int(light_tables[first_listed + low]), column = pixel % sky_width, row = pixel / sky_width;
    float azimuth = float(PI) * (1.0 - 2.0 * (float(column) + 0.5 + tent(clamp(across, 0.0, 1.0))) / float(sky_width));
    float pixel_angle = float(PI) / float(sky_height), middle = (float(row) + 0.5) * pixel_angle;
    float polar = middle + tent(u.y) * pixel_angle, z = -cos(polar), sine = abs(sin(polar));
    // The distribution has the mean sine over the pixel. A difference of cosines would cancel near the poles.
    float mean_sine = 2.0 / pixel_angle * sin(middle) * sin(0.5 * pixel_angle);
    vec3 colour = table_vec3(first_sky_pixels + 4 * low);
    return sample_of(vec3(sine * cos(azimuth), sine * sin(azimuth), z), INFINITY,
                     colour * (sky_total * INVERSE_PI * sine / (luminance(colour) * mean_sine)));
}

Sample sample_emitter(const int e, const Receiver r, const vec3 p, const vec2 u)
{
    int kind = emitters[e].kind;
    Sample s;
    if (kind == POINT)
        s = sample_point_light(e, p, r.normal, u);
    else if (kind == SUN)
        s = sample_sun(e, u);
    else if (kind == TRIANGLE)
        s = sample_triangle(e, r, p, u);
    else
        s = sample_sky(u);
#ifdef MODULATED
    if (emitters[e].modulation > 0)
        s.light *= modulation(emitters[e].modulation, -s.direction, s.distance);
#endif
    return s;
}

// Clips a convex polygon to the half-space in front of a plane through the origin (Sutherland and Hodgman 1974).
// Returns the number of corners, at most one more. A convex polygon crosses the plane twice. If it lies in the plane,
// rounding may cause more crossings; only the first two count. All polygons share one array, because drivers copy
// arrays that are arguments; `from` and `to` are the indices of their first corners.
vec3 polygons[10];

int clip(const int from, const int count, const vec3 normal, const int to)
{
    int kept = 0, changes = 0;
    vec3 before = polygons[from + count - 1];
    float height = dot(before, normal);
    bool front = height > 0.0;
    for (int i = 0; i < count; ++i) {
        vec3 here = polygons[from + i];
        float now = dot(here, normal);
        if (changes < 2 && (now > 0.0) != front) {
            polygons[to + kept++] = mix(before, here, height / (height - now));
            front = !front;
            ++changes;
        }
        if (front)
            polygons[to + kept++] = here;
        before = here;
        height = now;
    }
    return kept;
}

// Returns the unoccluded irradiance (E/pi) at a point from a uniform triangle: the analytic form factor of the part
// above both horizons, of the smooth and the geometric normal (Lambert 1760; Arvo 1995).
vec3 open_light(const int e, const vec3 p, const Receiver r)
{
    vec3 a = TO_VEC3(emitters[e].position) - p, edge1 = TO_VEC3(emitters[e].edge1), edge2 = TO_VEC3(emitters[e].edge2);
    vec3 facing = cross(edge1, edge2);
    bool front = dot(facing, a) < 0.0;
    if (!front && (emitters[e].triangle < 0 || emitters[e].one_sided != 0))
        return vec3(0.0);
    vec3 radiance = front ? strength_of(e) : TO_VEC3(emitters[e].back_strength);
    vec3 horizon = horizon_of(r, !shows_front(r, a, facing));
    vec3 b = a + edge1, c = a + edge2;
    polygons[0] = a;
    polygons[1] = b;
    polygons[2] = c;
    int count = 3;
    float lowest = min(min(min(dot(a, horizon), dot(b, horizon)), dot(c, horizon)),
                       min(min(dot(a, r.normal), dot(b, r.normal)), dot(c, r.normal)));
    for (int plane = 0; plane < 2 && !(lowest > 0.0) && count > 2; ++plane)
        count = clip(5 * plane, count, plane == 0 ? horizon : r.normal, 5 - 5 * plane);
    if (count < 3)
        return vec3(0.0);
    float sum = 0.0;
    vec3 from = normalize(polygons[count - 1]);
    for (int i = 0; i < count; ++i) {
        vec3 to = normalize(polygons[i]), side = cross(from, to);
        float sine = length(side);
        sum += sine > 1e-12 ? atan(sine, dot(from, to)) / sine * dot(side, r.normal) : 0.0;
        from = to;
    }
    return radiance * (abs(sum) * 0.5 * INVERSE_PI);
}

// Returns true if the irradiance from a triangle hardly varies over a texel.
bool is_far(const int e, const Receiver r)
{
    vec3 a = TO_VEC3(emitters[e].position) - r.at, edge1 = TO_VEC3(emitters[e].edge1);
    vec3 edge2 = TO_VEC3(emitters[e].edge2), middle = a + (edge1 + edge2) / 3.0, normal = cross(edge1, edge2);
    float radius = sqrt(max(dot(edge1, edge1), dot(edge2, edge2)));
    float distance = max(abs(dot(normal, a)) / max(length(normal), 1e-20), length(middle) - radius);
    return r.size < 0.05 * distance;
}

// Lights nearer than this fraction of a texel's width are spread over the texel in estimates.
#define SPREAD 0.1

// Estimates a point or spot light's luminous intensity in a direction. A fraction of the mean intensity is added, since
// the direction differs across the texel.
float own_strength(const int e, const vec3 away, const float distance)
{
#ifdef MODULATED
    if (emitters[e].modulation > 0) {
        vec3 factor = modulation(emitters[e].modulation, away, distance);
        return luminance(strength_of(e) * factor) + 0.05 * emitters[e].luminance;
    }
#endif
    return emitters[e].luminance;
}

// Estimates the unshadowed irradiance from a point or spot light, see `emitter_weight`.
float point_weight(const int e, const Receiver r)
{
    vec3 to = TO_VEC3(emitters[e].position) - r.at;
    float d2 = dot(to, to), d = sqrt(d2), radius = emitters[e].radius, reach = radius + r.size;
    if (dot(r.normal, to) < -reach || dot(r.horizon, to) < -reach)
        return 0.0;

    // The spot's cone is widened by the angle that the texel spans.
    float widest = emitters[e].cos_half_angle - 0.05 - r.size / max(d, 1e-20);
    vec3 away = -to / max(d, 1e-20);
    float spot = emitters[e].cos_half_angle >= -1.0 && radius == 0.0 && widest > -1.0
        ? in_cone(e, away, widest, 1.0) + 1e-4 : 1.0;
    float cosine = d < reach ? 1.0 : max(dot(r.normal, to) / max(d, 1e-20), 0.05);
    float near = max(radius, SPREAD * r.size);
    return own_strength(e, away, d) * spot * cosine / max(max(d2, near * near), LEAST);
}

// Estimates the unshadowed irradiance from a triangle, see `emitter_weight`.
float triangle_weight(const int e, const Receiver r)
{
    vec3 edge1 = TO_VEC3(emitters[e].edge1), edge2 = TO_VEC3(emitters[e].edge2), normal = cross(edge1, edge2);
    vec3 a = TO_VEC3(emitters[e].position) - r.at, b = a + edge1, c = a + edge2;
    vec3 horizon = horizon_of(r, !shows_front(r, a, normal));
    float top = max(max(dot(a, horizon), dot(b, horizon)), dot(c, horizon));
    if (top <= max(1e-5 * length(a), r.height))
        return 0.0;
    float facing = -dot(normal, a), twice = length(normal);
    if ((emitters[e].triangle < 0 || emitters[e].one_sided != 0) && facing <= -r.size * twice)
        return 0.0;
    vec3 middle = (a + b + c) / 3.0;
    float d2 = dot(middle, middle), d = sqrt(d2);
    float angle = min(0.5 * twice * max(abs(facing) / (twice * d), 0.02) / d2, 6.2831853);
    float about = emitters[e].luminance * angle * max(dot(middle, r.normal) / d, 0.1);
    if (emitters[e].uniform_ == 0)
        return about;

    // Uniform radiance: the analytic irradiance, with a lower bound for light that reaches only other points of the
    // texel.
    return max(luminance(open_light(e, r.at, r)), 0.02 * about);
}

// Estimates the unshadowed irradiance from an emitter, for light selection. Returns 0 only if it contributes none.
float emitter_weight(const int e, const Receiver r)
{
    int kind = emitters[e].kind;
    if (kind == SKY_MAP)
        return sky_total * INVERSE_PI;
    if (kind == SUN)
        return dot(r.normal, -TO_VEC3(emitters[e].direction)) > -emitters[e].radius ? emitters[e].luminance : 0.0;
    return kind == POINT ? point_weight(e, r) : triangle_weight(e, r);
}
