#pragma once
// Kept samples of views: an entry in the bits below ENTRY_BITS and the index of a tint above. Entries are 0 for nothing,
// patch + 1 for the front of a patch, `outside` for the surroundings, then outside + 1 + patch + 1 for the back of a
// patch (outside + 1: a back without a patch).

#define ENTRY_BITS 26
#define ENTRY(kept) int((kept) & ((1u << ENTRY_BITS) - 1u))
#define TINT_INDEX(kept) int((kept) >> ENTRY_BITS)

// A sample below the horizon, of which the view has no part.
#define BELOW_HORIZON 0xffffffffu

uniform int outside;

#ifdef TINTED
// Values of a channel in the lattice of tints, and where that begins; tints that differ by less are the same
// (engine/scene/tints.py).
#define LEVELS 3
#define EXACT (64 - LEVELS * LEVELS * LEVELS)
#define SAME_TINT 1e-4

#define TINTED_BY(light, kept) ((light) * tint_at(TINT_INDEX(kept)))
#else
#define TINTED_BY(light, kept) (light)
#endif
