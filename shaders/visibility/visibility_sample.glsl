#pragma once
// Encoding of cached visibility samples: an entry in the bits below ENTRY_BITS and the palette index of a tint above.
// Entries are 0 for nothing, patch + 1 for the front face of a patch, `outside` for the background, and outside + 1 +
// patch + 1 for the back face of a patch (outside + 1: a back face without a patch).

#define ENTRY_BITS 26
#define ENTRY(kept) int((kept) & ((1u << ENTRY_BITS) - 1u))
#define TINT_INDEX(kept) int((kept) >> ENTRY_BITS)

// Sample below the geometric horizon, which does not contribute.
#define BELOW_HORIZON 0xffffffffu

uniform int outside;

#ifdef TINTED
// Values per channel in the lattice of tints, its first index, and the tolerance at which tints are equal
// (engine/scene/tints.py).
#define LEVELS 3
#define EXACT (64 - LEVELS * LEVELS * LEVELS)
#define SAME_TINT 1e-4

#define TINTED_BY(light, kept) ((light) * tint_at(TINT_INDEX(kept)))
#else
#define TINTED_BY(light, kept) (light)
#endif
