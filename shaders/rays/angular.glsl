// Transmittance of glass by the angle of incidence (engine/scene/transmission.py). cosine: of that angle.

// Returns the fraction of light that a face of glass transmits: sqrt((1 - F) / (1 + F)), with the unpolarised Fresnel
// reflectance F.
float through_face(float cosine, float ior)
{
    float squared = ior * ior - 1.0 + cosine * cosine;
    if (!(squared > 0.0))
        return 0.0;
    float g = sqrt(squared), first = (g - cosine) / (g + cosine);
    float second = (cosine * (g + cosine) - 1.0) / (cosine * (g - cosine) + 1.0);
    float reflected = min(0.5 * first * first * (1.0 + second * second), 1.0);
    return sqrt((1.0 - reflected) / (1.0 + reflected));
}

// Returns the opacity of glass at an angle of incidence, from its opacity at normal incidence. The two sides of a
// closed body together transmit as two faces (`body_transmittance` of engine/scene/transmission.py). fresnel: index of
// refraction, share of glass, number of faces, side of a body.
vec3 at_angle(vec3 stopped, vec4 fresnel, float cosine)
{
    if (!(fresnel.y > 0.0))
        return stopped;
    float face = through_face(cosine, fresnel.x) / max(through_face(1.0, fresnel.x), 1e-15);
    vec3 passed = (1.0 - stopped) * (1.0 - fresnel.y * (1.0 - pow(face, fresnel.z)));
    if (fresnel.w < 0.5)
        return 1.0 - passed;
    vec3 squared = passed * passed;
    return fresnel.w < 1.5 ? 0.5 - 0.5 * squared : (1.0 - squared) / (1.0 + squared);
}

float at_angle(float stopped, vec4 fresnel, float cosine)
{
    return at_angle(vec3(stopped), fresnel, cosine).x;
}
