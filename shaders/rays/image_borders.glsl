#pragma once
// Images beyond their borders: 0 repeated, 1 mirrored, 2 extended by their border, 3 zeros
// (EXTENSIONS in engine/scene/cutouts.py). As kernels/device/image_borders.cl.

// A point of an image that shows what another one far beyond its borders does: near enough for int.
vec2 near_image(const vec2 uv, const int extension)
{
    if (extension == 0)
        return uv - floor(uv);
    return extension == 1 ? uv - 2.0 * floor(0.5 * uv) : clamp(uv, -1.0, 2.0);
}

// The remainder of a division by a positive number, 0 or more.
int remainder_of(const int i, const int size)
{
    int rest = i - i / size * size;
    return rest < 0 ? rest + size : rest;
}

int wrapped(const int i, const int size, const int extension)
{
    if (extension == 0)
        return remainder_of(i, size);
    if (extension == 1) {
        int folded = remainder_of(i, 2 * size);
        return min(folded, 2 * size - 1 - folded);
    }
    return clamp(i, 0, size - 1);
}
