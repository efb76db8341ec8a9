#pragma once

// How images go on beyond their borders: 0 again and again, 1 mirrored, 2 by their border, 3 by zeros
// (EXTENSIONS in engine/scene/cutouts.py).

// A point of an image that shows what another one far beyond its borders does: near enough for int32.
float2 near_image(const float2 uv, const int extension)
{
    if (extension == 0)
        return uv - floor(uv);
    return extension == 1 ? uv - 2.0f * floor(0.5f * uv) : clamp(uv, -1.0f, 2.0f);
}

// What is left of a number divided by a positive one, 0 or more: in integers, since a card's quotient of two equal
// numbers may be a little less than 1.
int remainder_of(const int i, const int size)
{
    const int rest = i % size;
    return rest < 0 ? rest + size : rest;
}

int wrapped(const int i, const int size, const int extension)
{
    if (extension == 0)
        return remainder_of(i, size);
    if (extension == 1) {
        const int folded = remainder_of(i, 2 * size);
        return min(folded, 2 * size - 1 - folded);
    }
    return clamp(i, 0, size - 1);
}
