#version 410
in vec2 in_uv;
uniform float resolution;
out vec2 corner;

void main()
{
    corner = in_uv * resolution;
}
