#pragma once

// Red, green and blue of a colour together.
float sum3(const float4 v) { return v.x + v.y + v.z; }
