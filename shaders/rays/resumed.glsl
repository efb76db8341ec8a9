#pragma once
#include "bvh_traversal.glsl"

// Splits the work of an item over several dispatches: an item pauses after MAX_STEPS traversal steps, and its state
// waits in a buffer (engine/visibility/rays/shaders/shader_tracer.py). This also keeps dispatches short.

// 1 if any item has paused; then STATE_WORDS words for each item of the slice. The first word of an item is 0 if it is
// new, 1 if it has paused, and 2 if it is done.
layout(std430, binding = 8) buffer States { uint states[]; };

// Eight lanes of llvmpipe share its limit of 65,535 steps, and each lane finishes its last sample after the pause is
// due.
#define MAX_STEPS 2048

int state_cursor;   // the next word of the item's state
bool state_saves;   // true while the state is stored, false while it is loaded

// Moves to the state of an item of the slice; returns its first word.
uint begin_state(const int item, const bool saves)
{
    state_cursor = 1 + STATE_WORDS * item;
    state_saves = saves;
    return states[state_cursor++];
}

void end_state(const int item, const bool done)
{
    states[1 + STATE_WORDS * item] = done ? 2u : 1u;
    if (!done)
        states[0] = 1u;
}

// Stores or loads one value of the state, so that one list of values serves both directions.
void exchange(inout float x)
{
    if (state_saves)
        states[state_cursor] = floatBitsToUint(x);
    else
        x = uintBitsToFloat(states[state_cursor]);
    ++state_cursor;
}

void exchange(inout int x)
{
    if (state_saves)
        states[state_cursor] = uint(x);
    else
        x = int(states[state_cursor]);
    ++state_cursor;
}

void exchange(inout vec2 x)
{
    exchange(x.x);
    exchange(x.y);
}

void exchange(inout vec3 x)
{
    exchange(x.x);
    exchange(x.y);
    exchange(x.z);
}
