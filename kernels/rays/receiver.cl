#pragma once

// Receivers of light: the geometry of a patch, the origins of its rays, and sample directions around its normal.

// Receiver as unpacked from its record (engine/visibility/rays/receiver_records.py).
typedef struct {
    float3 at, normal, geometric, edge_u, edge_v;  // world space, metres; steps of a texel
    float3 corner, edge1, edge2;                   // triangle of the texel
    float3 normals[3];                             // normals at the corners
    float height, size;                            // height of ray origins above the surface; texel size; metres
    float lifted;                                  // factor of `smooth_offset`, 0 to 1: 0 on flat surfaces
    uint rank;                                     // index along a Hilbert curve through the texels
    bool crossed;                                  // True if a face crosses the texel
    float3 horizon;                                // normal of the plane below which lights contribute nothing
} Receiver;

Receiver load_receiver(__global const ReceiverRecord *record)
{
    const float3 normal = vload3(0, record->normal), geometric = vload3(0, record->geometric);
    const float3 edge_u = vload3(0, record->edge_u), edge_v = vload3(0, record->edge_v);
    const float lifted = record->lifted;
    const Receiver r = {vload3(0, record->at),
                        normal,
                        geometric,
                        edge_u,
                        edge_v,
                        vload3(0, record->corner),
                        vload3(0, record->edge1),
                        vload3(0, record->edge2),
                        {vload3(0, record->normal1), vload3(0, record->normal2), vload3(0, record->normal3)},
                        record->height,
                        fmax(length(edge_u), length(edge_v)),
                        lifted,
                        (uint)record->rank >> 1,
                        record->rank & 1,
                        lifted > 0.0f ? normal : geometric};
    return r;
}

// Cosines between face normal and vertex normal. Below the first the vertex gives no offset, above the second the full
// one (chosen).
#define LEANS_MUCH 0.64f
#define LEANS_LITTLE 0.82f

// Minimum height of the smooth surface above its triangle, as a fraction of the longest edge. Smaller heights are
// rounding errors.
#define FLAT 1e-4f

// Returns the offset from a point of the flat triangle to the smooth surface: the point is projected onto the tangent
// planes of the three vertices, outwards only (Hanika, "Hacking the Shadow Terminator", Ray Tracing Gems II, 2021).
float3 smooth_offset(const Receiver *r, const float3 p)
{
    const float3 q = p - r->corner, face = cross(r->edge1, r->edge2);
    const float square = dot(face, face);
    if (!(square > 0.0f))
        return (float3)(0.0f);
    const float v = dot(cross(q, r->edge2), face) / square, w = dot(cross(r->edge1, q), face) / square;
    const float longest = sqrt(fmax(dot(r->edge1, r->edge1), dot(r->edge2, r->edge2)));
    const float3 rise =
        -(float3)(dot(q, r->normals[0]), dot(q - r->edge1, r->normals[1]), dot(q - r->edge2, r->normals[2]));
    const float3 upright =
        (float3)(dot(r->normals[0], r->geometric), dot(r->normals[1], r->geometric), dot(r->normals[2], r->geometric));
    const float3 trusted = clamp((upright - LEANS_MUCH) / (LEANS_LITTLE - LEANS_MUCH), 0.0f, 1.0f);
    const float3 amount = fmax(rise - fmax(FLAT * longest, 0.5f * r->height), 0.0f) * trusted
        * clamp((float3)(1.0f - v - w, v, w), 0.0f, 1.0f);
    return amount.x * r->normals[0] + amount.y * r->normals[1] + amount.z * r->normals[2];
}

// Sine of the elevation below which rays start on the smooth surface instead of the triangle; Cycles uses the same
// value (kernel/light/sample.h, shadow_ray_offset).
#define GRAZING 0.1f

// Returns the normal of the horizon plane: emitters below it contribute nothing. Back faces use the geometric normal,
// so that faces of a convex object do not light each other where smooth normals lean.
float3 horizon_of(const Receiver *r, const bool back) { return back ? r->geometric : r->horizon; }

// Returns the vector from a point of the patch to the origin of its ray in a direction: the height above the surface
// plus, near the horizon, the offset to the smooth surface.
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

// Returns a point of the texel that lies in the patch's triangle: the given one, the one mirrored at the centre, or the
// centre. at: 0..1 along u and v.
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

// Maps the unit square to the unit disk, uniform in area. Sine and cosine are minimax polynomials on [-pi/4, pi/4],
// with errors below float32 rounding: the libraries of CPUs take four times as long (measured).
float2 disk(const float2 u)
{
    const float quarters = 4.0f * u.y, quarter = rint(quarters), x = quarters - quarter, z = x * x;
    const float sine = x * (1.57079637f + z * (-0.64596349f + z * (0.0796802267f - z * 0.00460217707f)));
    const float cosine = 1.0f + z * (-1.23370051f + z * (0.253669232f + z * (-0.0208602883f + z * 0.000904021668f)));
    const int turn = (int)quarter;
    const float radius = turn & 2 ? -sqrt(u.x) : sqrt(u.x);
    return radius * (turn & 1 ? (float2)(-sine, cosine) : (float2)(cosine, sine));
}

// Returns a cosine-distributed direction around z for a point of the unit square.
float3 cosine_direction(const float2 u, const float3 x, const float3 y, const float3 z)
{
    const float2 q = disk(u);
    return q.x * x + q.y * y + sqrt(fmax(1.0f - dot(q, q), 0.0f)) * z;
}
