#pragma once
#include "bvh_traversal.glsl"

// Work of an item in several dispatches: it pauses after MAX_STEPS steps, and its state waits in a buffer
// (engine/visibility/rays/shaders/shader_tracer.py). Dispatches stay short, too.

// 1 if any item has paused; then STATE_WORDS of each item of the slice, of which the first one is 0 for a new item, 1 for
// one that has paused and 2 for one that is done.
layout(std430, binding = 8) buffer States { uint states[]; };

// Eight lanes of llvmpipe share the limit of 65,535 steps, and each ends its last sample.
#define MAX_STEPS 2048

int state_cursor;   // the next word of the item's state
bool state_saves;   // true while the state is stored, false while it is loaded

// To the state of an item of the slice; return its first word.
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

// Store or load a value: one list of them serves both.
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
