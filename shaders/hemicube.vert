#version 410
// Passes the triangle on; the geometry shader places it in every face of the instance's hemicube.
// CUTOUTS is defined for scenes with see-through surfaces.
in vec3 in_position;
in vec3 in_lookup;
#ifdef CUTOUTS
in vec3 in_cutout;
out vec3 cutout_corner;
#endif
out vec3 position;
out vec3 lookup;
flat out int instance;

void main()
{
    position = in_position;
    lookup = in_lookup;
#ifdef CUTOUTS
    cutout_corner = in_cutout;
#endif
    instance = gl_InstanceID;
}
