#pragma once
// Coordinates outside images, by extension mode: 0 repeat, 1 mirror, 2 extend the border pixels, 3 zeros (EXTENSIONS in
// engine/scene/cutouts.py). The same algorithm as kernels/device/image_borders.cl.

// Returns equivalent coordinates near the image for a point far outside, so that they fit an int.
vec2 near_image(const vec2 uv, const int extension)
{
    if (extension == 0)
        return uv - floor(uv);
    return extension == 1 ? uv - 2.0 * floor(0.5 * uv) : clamp(uv, -1.0, 2.0);
}

// Returns the non-negative remainder of a division by a positive number.
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
