// How images go on beyond their borders: 0 again and again, 1 mirrored, 2 by their border, 3 by zeros
// (EXTENSIONS in engine/scene/cutouts.py).

// A point of an image that shows what another one far beyond its borders does: near enough for int32.
float2 near_image(const float2 uv, const int extension)
{
    if (extension == 0)
        return uv - floor(uv);
    return extension == 1 ? uv - 2.0f * floor(0.5f * uv) : clamp(uv, -1.0f, 2.0f);
}

int wrapped(const int i, const int size, const int extension)
{
    if (extension == 0)
        return i - size * (int)floor((float)i / size);
    if (extension == 1) {
        const int folded = i - 2 * size * (int)floor((float)i / (2 * size));
        return min(folded, 2 * size - 1 - folded);
    }
    return clamp(i, 0, size - 1);
}
