#pragma once

// Where light is received: a patch, the start of its rays, directions around its normal.

// A record (engine/visibility/rays/receiver_records.py), and what follows from it.
typedef struct {
    float3 at, normal, geometric, edge_u, edge_v;  // world space, metres; steps of a texel
    float3 corner, edge1, edge2;                   // its triangle
    float3 normals[3];                             // of the triangle's corners
    float height, size;                            // of the start of rays above the surface; of the texel
    float lifted;                                  // factor of `smooth_offset`, 0 to 1: 0 on flat surfaces
    uint rank;                                     // along a curve through the texels
    bool crossed;                                  // whether a face crosses the texel
    float3 horizon;                                // normal of the plane beyond which no lamp is seen
} Receiver;

Receiver load_receiver(__global const ReceiverRecord *record)
{
    const float3 normal = vload3(0, record->normal), geometric = vload3(0, record->geometric);
    const float3 edge_u = vload3(0, record->edge_u), edge_v = vload3(0, record->edge_v);
    const float lifted = record->lifted;
    const Receiver r = {
        vload3(0, record->at), normal, geometric, edge_u, edge_v,
        vload3(0, record->corner), vload3(0, record->edge1), vload3(0, record->edge2),
        {vload3(0, record->normal1), vload3(0, record->normal2), vload3(0, record->normal3)},
        record->height, fmax(length(edge_u), length(edge_v)), lifted, (uint)record->rank >> 1,
        record->rank & 1, lifted > 0.0f ? normal : geometric
    };
    return r;
}

// Cosines between the normals of a face and of its corners: beyond the first the surface counts as not smooth.
#define LEANS_MUCH 0.64f
#define LEANS_LITTLE 0.82f

// The smooth surface is above its triangle from this fraction of the longest edge on: less comes from rounding.
#define FLAT 1e-4f

// How far outside of its flat triangle the smooth surface is at a point: the point is projected on the planes
// of the three vertices, outwards only (Hanika, "Hacking the Shadow Terminator", Ray Tracing Gems II 2021).
float3 smooth_offset(const Receiver *r, const float3 p)
{
    const float3 q = p - r->corner, face = cross(r->edge1, r->edge2);
    const float square = dot(face, face);
    if (!(square > 0.0f))
        return (float3)(0.0f);
    const float v = dot(cross(q, r->edge2), face) / square, w = dot(cross(r->edge1, q), face) / square;
    const float longest = sqrt(fmax(dot(r->edge1, r->edge1), dot(r->edge2, r->edge2)));
    const float3 rise = -(float3)(dot(q, r->normals[0]), dot(q - r->edge1, r->normals[1]),
                                  dot(q - r->edge2, r->normals[2]));
    const float3 upright = (float3)(dot(r->normals[0], r->geometric), dot(r->normals[1], r->geometric),
                                    dot(r->normals[2], r->geometric));
    const float3 trusted = clamp((upright - LEANS_MUCH) / (LEANS_LITTLE - LEANS_MUCH), 0.0f, 1.0f);
    const float3 amount = fmax(rise - fmax(FLAT * longest, 0.5f * r->height), 0.0f) * trusted
        * clamp((float3)(1.0f - v - w, v, w), 0.0f, 1.0f);
    return amount.x * r->normals[0] + amount.y * r->normals[1] + amount.z * r->normals[2];
}

// Rays that leave at less than this (the sine of their angle) above the flat or the smooth surface start at
// the smooth one, others on their triangle: as Cycles (kernel/light/sample.h, shadow_ray_offset).
#define GRAZING 0.1f

// Normal of the plane beyond which a patch sees no lamp, or no back of a surface: faces that look away from
// each other, as those of a ball do, see nothing of each other though their normals lean.
float3 horizon_of(const Receiver *r, const bool back) { return back ? r->geometric : r->horizon; }

// From a point of the patch to where its ray in a direction starts.
float3 ray_origin(const Receiver *r, const float3 p, const float3 direction)
{
    const float3 start = r->height * r->geometric;
    if (!(r->lifted > 0.0f))
        return start;
    const float over = dot(direction, r->geometric), up = dot(direction, r->normal);
    const float amount = up < GRAZING ? 2.0f - (over + up) / GRAZING : 1.0f - over / GRAZING;
    return amount > 0.0f ? start + r->lifted * fmin(amount, 1.0f) * smooth_offset(r, p) : start;
}

bool in_triangle(const Receiver *r, const float3 p)
{
    const float3 q = p - r->corner, normal = cross(r->edge1, r->edge2);
    const float u = dot(cross(q, r->edge2), normal), v = dot(cross(r->edge1, q), normal);
    return u >= 0.0f && v >= 0.0f && u + v <= dot(normal, normal);
}

// A point of the patch's texel that lies in the patch's triangle: this one, the one opposite, or the centre.
float3 point_of_texel(const Receiver *r, const float2 at)
{
    const float3 offset = (at.x - 0.5f) * r->edge_u + (at.y - 0.5f) * r->edge_v;
    if (in_triangle(r, r->at + offset))
        return r->at + offset;
    return in_triangle(r, r->at - offset) ? r->at - offset : r->at;
}

uint hash(uint x)
{
    // lowbias32 (Wellons 2018)
    x = (x ^ (x >> 16)) * 0x7feb352du;
    x = (x ^ (x >> 15)) * 0x846ca68bu;
    return x ^ (x >> 16);
}

void basis(const float3 z, float3 *x, float3 *y)
{
    // Duff et al. 2017
    const float sign = z.z < 0.0f ? -1.0f : 1.0f, a = -1.0f / (sign + z.z), b = z.x * z.y * a;
    *x = (float3)(1.0f + sign * z.x * z.x * a, sign * b, -sign * z.x);
    *y = (float3)(b, sign + z.y * z.y * a, -z.y);
}

// A point of the unit disk from one of the unit square, by area. Sine and cosine, of an eighth of a turn to each side of
// a quarter, are polynomials whose largest error is the least, below that of rounding: libraries of processors take
// four times as long.
float2 disk(const float2 u)
{
    const float quarters = 4.0f * u.y, quarter = rint(quarters), x = quarters - quarter, z = x * x;
    const float sine = x * (1.57079637f + z * (-0.64596349f + z * (0.0796802267f - z * 0.00460217707f)));
    const float cosine = 1.0f + z * (-1.23370051f + z * (0.253669232f + z * (-0.0208602883f + z * 0.000904021668f)));
    const int turn = (int)quarter;
    const float radius = turn & 2 ? -sqrt(u.x) : sqrt(u.x);
    return radius * (turn & 1 ? (float2)(-sine, cosine) : (float2)(cosine, sine));
}

// A direction around z, by the cosine, from a point of the unit square.
float3 cosine_direction(const float2 u, const float3 x, const float3 y, const float3 z)
{
    const float2 q = disk(u);
    return q.x * x + q.y * y + sqrt(fmax(1.0f - dot(q, q), 0.0f)) * z;
}
