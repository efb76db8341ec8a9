//! Shows the lightmaps that Hemibake baked in Blender, and changes their light between states.
//!
//! In Blender, choose *Export for Engine* with *Engine: Bevy*, and put the files in the assets of the app:
//!
//! ```no_run
//! use bevy::prelude::*;
//! use bevy_hemibake::HemibakePlugin;
//!
//! fn main() {
//!     App::new().add_plugins((DefaultPlugins, HemibakePlugin)).add_systems(Startup, setup).run();
//! }
//!
//! fn setup(mut commands: Commands, assets: Res<AssetServer>) {
//!     commands.spawn(SceneRoot(assets.load("room.glb#Scene0")));
//!     commands.spawn((Camera3d::default(), Transform::from_xyz(0.0, 1.6, 4.0)));
//! }
//! ```
//!
//! [`LightControl`] switches and fades light states and groups:
//!
//! ```no_run
//! # use bevy::prelude::*;
//! # use bevy_hemibake::{HemibakePlugin, LightControl, LightmapsReady};
//! # let mut app = App::new();
//! app.add_observer(|ready: On<LightmapsReady>, mut scenes: Query<&mut LightControl>| -> Result {
//!     if let Ok(mut light) = scenes.get_mut(ready.event_target()) {
//!         light.set_state("Night", 2.0)?;
//!     }
//!     Ok(())
//! });
//! ```
//!
//! [`LightmapProblem`] reports what cannot be displayed.

mod directional;
mod gltf_lightmaps;
mod hdr_inside;
mod light_control;
mod loading;
pub mod manifest;
mod manifest_cache;
mod map_files;
mod mixing;
mod pending;
mod probes;
mod settings;

use bevy::{
    app::{App, Plugin, Update},
    ecs::prelude::*,
    gltf::extensions::GltfExtensionHandlers,
    tasks::block_on,
};

pub use directional::{DirectionalLight, DirectionalMaterial};
pub use hdr_inside::HdrInsidePlugin;
pub use light_control::{LightControl, UnknownName};
pub use loading::{LightmapProblem, Lightmapped, LightmapsReady};
pub use manifest::LightmapUvs;
pub use probes::ProbeVolumes;
pub use settings::HemibakeSettings;

/// Plug-in that shows the lightmaps of all glTF scenes; add it after `DefaultPlugins`.
pub struct HemibakePlugin;

impl Plugin for HemibakePlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<HemibakeSettings>()
            .init_resource::<manifest_cache::ManifestCache>()
            .add_message::<LightmapProblem>()
            .register_type::<gltf_lightmaps::LightmappedScene>()
            .register_type::<gltf_lightmaps::LightmapIndex>()
            .add_plugins((mixing::MixPlugin, directional::DirectionalPlugin))
            .add_systems(
                Update,
                (
                    (loading::start_loading, loading::start_volumes),
                    loading::finish_loading,
                    (
                        loading::report_ready,
                        loading::set_exposure,
                        probes::set_intensity,
                    ),
                    light_control::advance_fades,
                )
                    .chain(),
            );
        let handlers = app.world().resource::<GltfExtensionHandlers>();
        // The lock has no blocking method on the web.
        block_on(handlers.0.write()).push(Box::new(gltf_lightmaps::GltfLightmaps::default()));
    }
}
