#pragma once
#include "receiver.glsl"

// Low-discrepancy sequences for light samples. The same sequences as in kernels/direct/emitters.cl.

float unit_float(const uint bits) { return float(bits >> 8) * (1.0 / 16777216.0); }

uint reversed_bits(const uint x) { return bitfieldReverse(x); }

// Returns sample i of two 2D low-discrepancy sequences, randomly shifted per patch (Cranley-Patterson rotation): R2
// (Roberts 2018) in xy, van der Corput and golden ratio in zw.
vec4 sample_point(const uint index, const uint seed)
{
    uvec4 shift = uvec4(hash(seed), hash(seed + 0x9e3779b9u), hash(seed + 0x3c6ef372u), hash(seed + 0xdaa66d2bu));
    uint i = index + 1u;
    uvec4 point = uvec4(i * 3242174889u, i * 2447445414u, reversed_bits(i), i * 2654435769u);
    return vec4((point + shift) >> 8) * (1.0 / 16777216.0);
}
