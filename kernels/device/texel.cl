#pragma once

// Work items map to image texels: column, row, image index.

#define AT(x, y) (((size_t)get_global_id(2) * height + (y)) * width + (x))

#define TEXEL \
    const int x = get_global_id(0), y = get_global_id(1); \
    if (x >= width || y >= height) \
        return; \
    const size_t texel = AT(x, y)
