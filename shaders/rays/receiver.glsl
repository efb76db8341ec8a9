#pragma once
// Receivers of light: the geometry of a patch, the origins of its rays, and sample directions around its normal. The
// same as kernels/rays/receiver.cl.

#define TO_VEC3(a) vec3((a)[0], (a)[1], (a)[2])

// Receiver as unpacked from its record (engine/visibility/rays/receiver_records.py), with derived values.
struct Receiver {
    vec3 at, normal, geometric, edge_u, edge_v;  // world space, metres; steps of a texel
    vec3 corner, edge1, edge2;                   // triangle of the texel
    vec3 normal1, normal2, normal3;              // normals at the corners
    float height, size;                          // height of ray origins above the surface; texel size; metres
    float lifted;                                // factor of `smooth_offset`, 0 to 1: 0 on flat surfaces
    uint rank;                                   // index along a Hilbert curve through the texels
    bool crossed;                                // true if a face crosses the texel
    vec3 horizon;                                // normal of the plane below which lights contribute nothing
};

layout(std430, binding = 3) RECEIVER_ACCESS buffer Receivers { ReceiverRecord receivers[]; };

Receiver load_receiver(const int i)
{
    Receiver r;
    r.at = TO_VEC3(receivers[i].at);
    r.normal = TO_VEC3(receivers[i].normal);
    r.geometric = TO_VEC3(receivers[i].geometric);
    r.edge_u = TO_VEC3(receivers[i].edge_u);
    r.edge_v = TO_VEC3(receivers[i].edge_v);
    r.corner = TO_VEC3(receivers[i].corner);
    r.edge1 = TO_VEC3(receivers[i].edge1);
    r.edge2 = TO_VEC3(receivers[i].edge2);
    r.normal1 = TO_VEC3(receivers[i].normal1);
    r.normal2 = TO_VEC3(receivers[i].normal2);
    r.normal3 = TO_VEC3(receivers[i].normal3);
    r.height = receivers[i].height;
    r.size = max(length(r.edge_u), length(r.edge_v));
    r.lifted = receivers[i].lifted;
    r.rank = uint(receivers[i].rank) >> 1;
    r.crossed = (receivers[i].rank & 1) != 0;
    r.horizon = r.lifted > 0.0 ? r.normal : r.geometric;
    return r;
}

// Cosines between face normal and vertex normal. Below the first the vertex gives no offset, above the second the full
// one (chosen).
#define LEANS_MUCH 0.64
#define LEANS_LITTLE 0.82

// Minimum height of the smooth surface above its triangle, as a fraction of the longest edge. Smaller heights are
// rounding errors.
#define FLAT 1e-4

// Returns the offset from a point of the flat triangle to the smooth surface: the point is projected onto the tangent
// planes of the three vertices, outwards only (Hanika, "Hacking the Shadow Terminator", Ray Tracing Gems II, 2021).
vec3 smooth_offset(const Receiver r, const vec3 p)
{
    vec3 q = p - r.corner, face = cross(r.edge1, r.edge2);
    float square = dot(face, face);
    if (!(square > 0.0))
        return vec3(0.0);
    float v = dot(cross(q, r.edge2), face) / square, w = dot(cross(r.edge1, q), face) / square;
    float longest = sqrt(max(dot(r.edge1, r.edge1), dot(r.edge2, r.edge2)));
    vec3 rise = -vec3(dot(q, r.normal1), dot(q - r.edge1, r.normal2), dot(q - r.edge2, r.normal3));
    vec3 upright = vec3(dot(r.normal1, r.geometric), dot(r.normal2, r.geometric), dot(r.normal3, r.geometric));
    vec3 trusted = clamp((upright - LEANS_MUCH) / (LEANS_LITTLE - LEANS_MUCH), 0.0, 1.0);
    vec3 amount = max(rise - max(FLAT * longest, 0.5 * r.height), 0.0) * trusted
        * clamp(vec3(1.0 - v - w, v, w), 0.0, 1.0);
    return amount.x * r.normal1 + amount.y * r.normal2 + amount.z * r.normal3;
}

// Sine of the elevation below which rays start on the smooth surface instead of the triangle; Cycles uses the same
// value (kernel/light/sample.h, shadow_ray_offset).
#define GRAZING 0.1

// Returns the normal of the horizon plane: emitters below it contribute nothing. Back faces use the geometric normal.
vec3 horizon_of(const Receiver r, const bool back) { return back ? r.geometric : r.horizon; }

// Returns the vector from a point of the patch to the origin of its ray in a direction.
vec3 ray_origin(const Receiver r, const vec3 p, const vec3 direction)
{
    vec3 start = r.height * r.geometric;
    if (!(r.lifted > 0.0))
        return start;
    float over = dot(direction, r.geometric), up = dot(direction, r.normal);
    float amount = up < GRAZING ? 2.0 - (over + up) / GRAZING : 1.0 - over / GRAZING;
    return amount > 0.0 ? start + r.lifted * min(amount, 1.0) * smooth_offset(r, p) : start;
}

bool in_triangle(const Receiver r, const vec3 p)
{
    vec3 q = p - r.corner, normal = cross(r.edge1, r.edge2);
    float u = dot(cross(q, r.edge2), normal), v = dot(cross(r.edge1, q), normal);
    return u >= 0.0 && v >= 0.0 && u + v <= dot(normal, normal);
}

// Returns a point of the texel that lies in the patch's triangle: the given one, the one mirrored at the centre, or the
// centre.
vec3 point_of_texel(const Receiver r, const vec2 at)
{
    vec3 offset = (at.x - 0.5) * r.edge_u + (at.y - 0.5) * r.edge_v;
    if (in_triangle(r, r.at + offset))
        return r.at + offset;
    return in_triangle(r, r.at - offset) ? r.at - offset : r.at;
}

uint hash(uint x)
{
    // lowbias32 (Wellons 2018)
    x = (x ^ (x >> 16)) * 0x7feb352du;
    x = (x ^ (x >> 15)) * 0x846ca68bu;
    return x ^ (x >> 16);
}

void basis(const vec3 z, out vec3 x, out vec3 y)
{
    // Duff et al. 2017
    float side = z.z < 0.0 ? -1.0 : 1.0, a = -1.0 / (side + z.z), b = z.x * z.y * a;
    x = vec3(1.0 + side * z.x * z.x * a, side * b, -side * z.x);
    y = vec3(b, side + z.y * z.y * a, -z.y);
}

// Maps the unit square to the unit disk, uniform in area. Sine and cosine are the polynomials of
// kernels/rays/receiver.cl, so that both place samples alike.
vec2 disk(const vec2 u)
{
    float quarters = 4.0 * u.y, quarter = roundEven(quarters), x = quarters - quarter, z = x * x;
    float sine = x * (1.57079637 + z * (-0.64596349 + z * (0.0796802267 - z * 0.00460217707)));
    float cosine = 1.0 + z * (-1.23370051 + z * (0.253669232 + z * (-0.0208602883 + z * 0.000904021668)));
    int turn = int(quarter);
    float radius = (turn & 2) != 0 ? -sqrt(u.x) : sqrt(u.x);
    return radius * ((turn & 1) != 0 ? vec2(-sine, cosine) : vec2(cosine, sine));
}

// Returns a cosine-distributed direction around z for a point of the unit square.
vec3 cosine_direction(const vec2 u, const vec3 x, const vec3 y, const vec3 z)
{
    vec2 q = disk(u);
    return q.x * x + q.y * y + sqrt(max(1.0 - dot(q, q), 0.0)) * z;
}
