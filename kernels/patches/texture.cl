#pragma once
#include "image_borders.cl"

// Look-ups in image textures (engine/scene/texture.py).

// Converts sRGB to linear (IEC 61966-2-1).
float3 linear_of(const float3 display)
{
    const float3 bent = pow((fmax(display, 0.0f) + 0.055f) / 1.055f, 2.4f);
    return select(bent, display / 12.92f, islessequal(display, (float3)(0.04045f)));
}

typedef struct {
    __global const float *pixels;
    int width, height, extension;
} Image;

float3 pixel_at(const Image image, const int x, const int y)
{
    if (image.extension == 3 && (x < 0 || y < 0 || x >= image.width || y >= image.height))
        return (float3)(0.0f);
    const size_t row = wrapped(y, image.height, image.extension);
    return vload3(row * image.width + wrapped(x, image.width, image.extension), image.pixels);
}

float3 shown(const Image image, const float2 uv, const bool smooth, const bool srgb)
{
    const float2 pixel = near_image(uv, image.extension) * (float2)(image.width, image.height);
    const float2 low = floor(smooth ? pixel - 0.5f : pixel), f = pixel - 0.5f - low;
    const int x = (int)low.x, y = (int)low.y;
    float3 value = pixel_at(image, x, y);
    if (smooth)
        value = mix(mix(value, pixel_at(image, x + 1, y), f.x),
                    mix(pixel_at(image, x, y + 1), pixel_at(image, x + 1, y + 1), f.x), f.y);
    return srgb ? linear_of(value) : value;
}

float2 on_texture(__global const float2 *corner, const float3 weights)
{
    return weights.x * corner[0] + weights.y * corner[1] + weights.z * corner[2];
}
