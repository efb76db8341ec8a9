#pragma once

// Faces of cube maps, as in engine/reflections/cube_faces.py: +x, -x, +y, -y, +z, -z of left-handed axes with y up.
// A world direction (X, Y, Z) looks up (X, Z, Y).

// Returns the world direction of a point of a face, not normalised. at: columns and rows, -1..1.
float3 face_direction(const int face, const float2 at)
{
    const float side = face & 1 ? -1.0f : 1.0f;
    if (face < 2)
        return (float3)(side, -side * at.x, -at.y);
    if (face < 4)
        return (float3)(at.x, side * at.y, side);
    return (float3)(side * at.x, side, -at.y);
}

// Returns the face in a world direction, and in `at` the point on it, -1..1.
int face_of(const float3 direction, float2 *at)
{
    const float3 d = direction, size = fabs(d);
    if (size.x >= size.y && size.x >= size.z) {
        *at = (float2)(-copysign(1.0f, d.x) * d.y, -d.z) / size.x;
        return d.x < 0.0f;
    }
    if (size.z >= size.y) {
        *at = (float2)(d.x, copysign(1.0f, d.z) * d.y) / size.z;
        return 2 + (d.z < 0.0f);
    }
    *at = (float2)(copysign(1.0f, d.y) * d.x, -d.z) / size.y;
    return 4 + (d.y < 0.0f);
}
