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

// Returns the transmittance relative to normal incidence. fresnel: index of refraction, share of glass, number of faces.
float angular_factor(vec3 fresnel, float cosine)
{
    float face = through_face(cosine, fresnel.x) / max(through_face(1.0, fresnel.x), 1e-15);
    return 1.0 - fresnel.y * (1.0 - pow(face, fresnel.z));
}
