#version 410
in vec2 in_uv;

void main()
{
    gl_Position = vec4(2.0 * in_uv - 1.0, 0.0, 1.0);
}
