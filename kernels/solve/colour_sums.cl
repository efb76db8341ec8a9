#pragma once

// Returns the sum of red, green and blue.
float sum3(const float4 v) { return v.x + v.y + v.z; }
