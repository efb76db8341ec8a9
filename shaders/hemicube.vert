#version 410
// Passes the triangle on; the geometry shader places it in every face of the instance's hemicube.
in vec3 in_position;
in vec3 in_lookup;
out vec3 position;
out vec3 lookup;
flat out int instance;

void main()
{
    position = in_position;
    lookup = in_lookup;
    instance = gl_InstanceID;
}
