#pragma once

// Stencil links of an unknown texel to its neighbours, by index:
//
//     6 7 8
//     3 4 5     4 is the texel itself
//     0 1 2
//
// Bits of `linked`: 1 << link if a sample point reads both ends; SMOOTH << link if a smoothness term joins both ends.
#define LINKS 9
#define SMOOTH 512u
