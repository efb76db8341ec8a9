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
