#pragma once

// Extension modes of images beyond their borders: 0 repeat, 1 mirror, 2 extend the border pixels, 3 clip to zero
// (EXTENSIONS in engine/scene/cutouts.py).

// Returns an equivalent UV point near the image, so that pixel indices fit in int32.
float2 near_image(const float2 uv, const int extension)
{
    if (extension == 0)
        return uv - floor(uv);
    return extension == 1 ? uv - 2.0f * floor(0.5f * uv) : clamp(uv, -1.0f, 2.0f);
}

// Returns the non-negative remainder of an integer division. Integers are used because on GPUs a float quotient of
// equal numbers may be slightly below 1.
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
