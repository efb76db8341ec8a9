#pragma once

// Links of an unknown texel to those around it, by number:
//
//     6 7 8
//     3 4 5     4 is the texel itself
//     0 1 2
//
// Bits of `linked` tell what they stand for: 1 << link, some point reads both ends; SMOOTH << link, both ends shall
// be alike.
#define LINKS 9
#define SMOOTH 512u
