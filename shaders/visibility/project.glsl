// Projection matrices of hemicubes: four texels per face, one hemicube per row of texels.
uniform sampler2D matrices;

vec4 matrix_row(int slot, int index)
{
    return texelFetch(matrices, ivec2(index, slot), 0);
}

// Returns the clip position on a face; `precise`, so that every stage and driver path gives the same bits.
vec4 project(int slot, int face, vec3 position)
{
    precise vec4 clip;
    vec4 p = vec4(position, 1.0);
    clip.x = dot(matrix_row(slot, 4 * face), p);
    clip.y = dot(matrix_row(slot, 4 * face + 1), p);
    clip.z = dot(matrix_row(slot, 4 * face + 2), p);
    clip.w = dot(matrix_row(slot, 4 * face + 3), p);
    return clip;
}

// Returns the vector from the eye to a clip position, along the axes of the face. Side faces draw their upper half
// only: y = 2 v - w (engine/visibility/views/hemicube.py).
vec3 along_axes(int face, vec4 clip)
{
    return vec3(clip.x, face == 0 ? clip.y : 0.5 * (clip.y + clip.w), clip.w);
}
