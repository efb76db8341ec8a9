//! Light probes of a manifest as irradiance volumes, which light meshes without lightmaps.

use bevy::{
    asset::{AssetPath, AssetServer},
    ecs::prelude::*,
    light::{IrradianceVolume, LightProbe},
    prelude::{Name, Transform, Visibility},
};

use crate::{
    manifest::{Entry, Manifest, MapFile, ProbeVolume},
    map_files::{MapState, PendingMap},
    settings::HemibakeSettings,
};

/// Light probes of a manifest: spawn it to show the probe volumes of a bake.
///
/// A scene shows the probes of the manifest beside its glTF file without it, see
/// [`HemibakeSettings::shows_probes`].
///
/// ```no_run
/// # use bevy::prelude::*;
/// # use bevy_hemibake::ProbeVolumes;
/// # let mut world = World::new();
/// world.spawn(ProbeVolumes("lightmaps/hemibake.json".into()));
/// ```
#[derive(Component, Clone, Debug)]
#[require(Transform, Visibility)]
pub struct ProbeVolumes(
    /// Path of the manifest.
    pub String,
);

/// An irradiance volume of a bake.
#[derive(Component)]
pub(crate) struct BakedVolume;

/// A volume whose voxels are being loaded.
pub(crate) struct PendingVolume {
    volume: ProbeVolume,
    pub map: PendingMap,
}

impl PendingVolume {
    /// Starts to load the probe volumes of a manifest in a folder.
    pub fn load_all(
        manifest: &Manifest,
        server: &AssetServer,
        folder: &AssetPath<'static>,
    ) -> impl Iterator<Item = Self> {
        manifest.probes.iter().filter_map(move |volume| {
            let entry = Entry {
                format: "ktx2".into(),
                ..Entry::default()
            };
            let file = volume.ktx2.clone()?;
            Some(Self {
                volume: volume.clone(),
                map: PendingMap::load(server, folder, &MapFile { file, entry }),
            })
        })
    }

    /// Returns the components of the volume, or a message.
    pub fn bundle(self, settings: &HemibakeSettings) -> Result<impl Bundle, String> {
        let Self { volume, map } = self;
        if let MapState::Failed(reason) = map.state {
            return Err(format!(
                "Probe volume '{}': '{}' is not readable ({reason}). Put it beside the manifest, or bake again.",
                volume.name, map.file
            ));
        }
        Ok((
            Name::new(volume.name.clone()),
            transform_of(&volume)?,
            LightProbe,
            IrradianceVolume {
                voxels: map.image,
                intensity: settings.luminance(),
                affects_lightmapped_meshes: false,
            },
            BakedVolume,
        ))
    }
}

fn transform_of(volume: &ProbeVolume) -> Result<Transform, String> {
    let to_world = volume.to_world();
    let transform = Transform::from_matrix(to_world);
    if transform.to_matrix().abs_diff_eq(
        to_world,
        1e-4 * to_world.to_scale_rotation_translation().0.max_element(),
    ) {
        return Ok(transform);
    }
    Err(format!(
        "Probe volume '{}': Bevy shows no sheared volumes. Apply the scale of its parents in Blender, and bake again.",
        volume.name
    ))
}

/// Lets probe volumes show baked light as it is stored.
pub(crate) fn set_intensity(
    settings: Res<HemibakeSettings>,
    mut volumes: Query<&mut IrradianceVolume, With<BakedVolume>>,
) {
    if settings.is_changed() {
        for mut volume in &mut volumes {
            volume.intensity = settings.luminance();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn volume(matrix: [[f32; 4]; 4]) -> ProbeVolume {
        ProbeVolume {
            name: "Hall".into(),
            matrix,
            ktx2: None,
        }
    }

    #[test]
    fn a_turned_volume_has_a_transform() {
        // Half sizes 3, 2 and 1 m, turned by 90 degrees about z.
        let rows = [
            [0.0, -2.0, 0.0, 5.0],
            [3.0, 0.0, 0.0, -7.0],
            [0.0, 0.0, 1.0, 2.0],
            [0.0, 0.0, 0.0, 1.0],
        ];
        let transform = transform_of(&volume(rows)).unwrap();
        assert!(
            transform
                .translation
                .abs_diff_eq(bevy::math::Vec3::new(5.0, 2.0, 7.0), 1e-5)
        );
        assert!(
            transform
                .scale
                .abs_diff_eq(bevy::math::Vec3::new(6.0, 2.0, 4.0), 1e-5),
            "{transform:?}"
        );
    }

    #[test]
    fn a_sheared_volume_is_named() {
        let rows = [
            [1.0, 0.5, 0.0, 0.0],
            [0.0, 1.0, 0.0, 0.0],
            [0.0, 0.0, 1.0, 0.0],
            [0.0, 0.0, 0.0, 1.0],
        ];
        let error = transform_of(&volume(rows)).unwrap_err();
        assert!(
            error.starts_with("Probe volume 'Hall': Bevy shows no sheared volumes."),
            "{error}"
        );
    }
}
