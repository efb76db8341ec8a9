//! Settings of the plug-in, and the exposure of baked light.

use bevy::{camera::Exposure, ecs::prelude::*};

use crate::manifest::LightmapUvs;

/// Settings of [`HemibakePlugin`](crate::HemibakePlugin). A change of `ev100` applies at once, other changes to scenes
/// that are spawned later.
#[derive(Resource, Clone, Debug, PartialEq)]
pub struct HemibakeSettings {
    /// Exposure, EV100, at which a camera shows baked light as it is stored: irradiance / π × base color.
    ///
    /// The default is Bevy's default exposure, 9.7. Set the value of your camera's [`Exposure`] to show a baked white
    /// as white; leave it, and a change of the camera's exposure makes baked light brighter or darker.
    pub ev100: f32,
    /// Smooth lightmaps by a bicubic filter. Charts then need a margin of two texels.
    pub bicubic: bool,
    /// Prefer the files of the manifest to lightmaps in the glTF file.
    pub prefers_files: bool,
    /// Which UVs glTF files hold, for manifests of a bake.
    pub uvs: LightmapUvs,
    /// Shade normal maps with directional maps, where the files beside the glTF file have them. The material of these
    /// surfaces then is [`DirectionalMaterial`](crate::DirectionalMaterial).
    pub shades_normal_maps: bool,
    /// Show the probe volumes of the manifest as irradiance volumes, which light meshes without lightmaps.
    pub shows_probes: bool,
}

impl Default for HemibakeSettings {
    fn default() -> Self {
        Self {
            ev100: Exposure::EV100_BLENDER,
            bicubic: false,
            prefers_files: false,
            uvs: LightmapUvs::Final,
            shades_normal_maps: true,
            shows_probes: true,
        }
    }
}

impl HemibakeSettings {
    /// Returns the factor that cancels the camera's exposure, cd/m² per unit of baked light: 1.2 × 2^EV100.
    ///
    /// It is the value of [`StandardMaterial::lightmap_exposure`](bevy::pbr::StandardMaterial::lightmap_exposure) and
    /// [`IrradianceVolume::intensity`](bevy::light::IrradianceVolume::intensity). Bevy multiplies light by 1 / (1.2 ×
    /// 2^EV100), see [`Exposure::exposure`].
    pub fn luminance(&self) -> f32 {
        1.0 / Exposure { ev100: self.ev100 }.exposure()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn baked_light_cancels_the_exposure_of_the_default_camera() {
        let luminance = HemibakeSettings::default().luminance();
        assert!((luminance * Exposure::default().exposure() - 1.0).abs() < 1e-6);
        assert!((luminance - 998.0).abs() < 1.0, "{luminance}");
    }
}
