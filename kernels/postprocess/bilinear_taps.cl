#pragma once

// Bilinear taps: the four texels that a bilinear look-up of a lightmap reads, and their weights
// (engine/postprocess/bilinear.py).

// Distance from a row or column of texel centres below which a position counts as on it, texels.
#define ON_CENTRE 0.001953125f

// Taps of a bilinear lookup: lower left and upper right texel, and the weight of the latter along each axis.
typedef struct {
    int2 near, far;
    float2 part;
} Footprint;

// Returns the taps of a position in texels; the centre of texel (x, y) is at (x + 1/2, y + 1/2).
Footprint footprint_at(const float2 position, const int resolution)
{
    const float2 low = floor(position - 0.5f);
    float2 part = position - 0.5f - low;
    part = part < ON_CENTRE ? (float2)(0.0f) : part > 1.0f - ON_CENTRE ? (float2)(1.0f) : part;
    const int2 first = convert_int2(low), last = (int2)(resolution - 1);
    Footprint f = {clamp(first, (int2)(0), last), clamp(first + 1, (int2)(0), last), part};
    f.part = f.near == f.far ? (float2)(0.0f) : part;
    return f;
}

// Returns the texel (column, row) of one of the four taps: 0 lower left, 1 lower right, 2 upper left, 3 upper right.
int2 corner_of(const Footprint *f, const int corner)
{
    return (int2)(corner & 1 ? f->far.x : f->near.x, corner & 2 ? f->far.y : f->near.y);
}

float weight_of(const Footprint *f, const int corner)
{
    return (corner & 1 ? f->part.x : 1.0f - f->part.x) * (corner & 2 ? f->part.y : 1.0f - f->part.y);
}

uint flat_index(const int atlas, const int2 texel, const int resolution)
{
    return ((uint)atlas * resolution + texel.y) * resolution + texel.x;
}
