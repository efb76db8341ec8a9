//! Shows an exported glTF file with the crate bevy_hemibake, and writes pixels and messages to a folder.

use std::{env, fs, path::PathBuf, process, time::Duration};

use bevy::{
    app::ScheduleRunnerPlugin,
    camera::RenderTarget,
    core_pipeline::tonemapping::{DebandDither, Tonemapping},
    light::IrradianceVolume,
    prelude::*,
    render::{
        RenderPlugin,
        gpu_readback::{Readback, ReadbackComplete},
        render_resource::{TextureFormat, TextureUsages},
        settings::{RenderCreation, WgpuFeatures, WgpuSettings},
        view::Hdr,
    },
    scene::SceneInstanceReady,
};
use bevy_hemibake::{
    HdrInsidePlugin, HemibakePlugin, HemibakeSettings, LightControl, LightmapProblem,
    LightmapsReady, ProbeVolumes,
};
use serde::Deserialize;

/// Frames until everything is drawn.
const FRAMES: usize = 40;

/// Features that phones and WebGL 2 do not have: filtered 32-bit floats, 16-bit integers, arrays of textures.
const FEATURES: WgpuFeatures = WgpuFeatures::FLOAT32_FILTERABLE
    .union(WgpuFeatures::TEXTURE_FORMAT_16BIT_NORM)
    .union(WgpuFeatures::TEXTURE_BINDING_ARRAY);

/// What to show.
#[derive(Resource, Deserialize, Clone)]
struct Asked {
    /// Folder of the file.
    assets: String,
    file: String,
    /// Width and height of the picture, pixels.
    size: [u32; 2],
    /// Node of the camera.
    camera: String,
    /// Names of hidden nodes.
    hidden: Vec<String>,
    /// Light state; empty for none.
    state: String,
    /// Duration of the fade to it.
    seconds: f32,
    /// Light group, linear RGB and strength.
    group: Option<(String, [f32; 3], f32)>,
    /// Read Radiance HDR in the file.
    hdr_inside: bool,
    /// Leave out features that phones and WebGL 2 do not have.
    is_limited: bool,
    shades_normal_maps: bool,
    prefers_files: bool,
    bicubic: bool,
    /// Exposure of camera and settings.
    ev100: f32,
    /// Manifest of light probes; empty for none.
    probes: String,
    /// Linear radiance where nothing is shown.
    background: [f32; 3],
}

/// Folder of the answer.
#[derive(Resource)]
struct Answer(PathBuf);

#[derive(Resource)]
struct Target(Handle<Image>);

/// Frames since the light is complete.
#[derive(Resource, Default)]
struct Complete(Option<usize>);

fn main() {
    let folder = PathBuf::from(env::args().nth(1).expect("the folder of show.json"));
    let text = fs::read_to_string(folder.join("show.json")).expect("show.json");
    let asked: Asked = serde_json::from_str(&text).expect("JSON");
    let assets = AssetPlugin {
        file_path: asked.assets.clone(),
        ..default()
    };
    let renders = RenderPlugin {
        synchronous_pipeline_compilation: true,
        render_creation: RenderCreation::Automatic(WgpuSettings {
            disabled_features: asked.is_limited.then_some(FEATURES),
            ..default()
        }),
        ..default()
    };
    let [r, g, b] = asked.background;
    let mut app = App::new();
    app.add_plugins(DefaultPlugins.set(assets).set(renders))
        .add_plugins(ScheduleRunnerPlugin::run_loop(Duration::from_millis(1)))
        .insert_resource(ClearColor(Color::linear_rgb(r, g, b)))
        .insert_resource(GlobalAmbientLight {
            brightness: 0.0,
            ..default()
        })
        .insert_resource(HemibakeSettings {
            ev100: asked.ev100,
            bicubic: asked.bicubic,
            prefers_files: asked.prefers_files,
            shades_normal_maps: asked.shades_normal_maps,
            ..default()
        })
        .add_plugins(HemibakePlugin);
    if asked.hdr_inside {
        app.add_plugins(HdrInsidePlugin);
    }
    app.insert_resource(asked)
        .insert_resource(Answer(folder))
        .init_resource::<Complete>()
        .add_systems(Startup, load)
        .add_systems(Update, (report, read_back))
        .add_observer(prepare)
        .add_observer(change)
        .run();
}

fn load(
    mut commands: Commands,
    asked: Res<Asked>,
    assets: Res<AssetServer>,
    mut images: ResMut<Assets<Image>>,
) {
    let path = bevy::asset::AssetPath::from(PathBuf::from(&asked.file));
    commands.spawn(SceneRoot(assets.load(path.with_label("Scene0"))));
    if !asked.probes.is_empty() {
        commands.spawn(ProbeVolumes(asked.probes.clone()));
    }
    let [width, height] = asked.size;
    let mut target = Image::new_target_texture(width, height, TextureFormat::Rgba16Float, None);
    target.texture_descriptor.usage |= TextureUsages::COPY_SRC;
    commands.insert_resource(Target(images.add(target)));
}

/// Lets the camera of the file draw into the target, and hides nodes.
fn prepare(
    _: On<SceneInstanceReady>,
    mut commands: Commands,
    asked: Res<Asked>,
    target: Res<Target>,
    nodes: Query<(Entity, &Name), Without<Mesh3d>>,
) {
    for (entity, name) in &nodes {
        if name.as_str() == asked.camera {
            let picture = RenderTarget::Image(target.0.clone().into());
            let exposure = bevy::camera::Exposure { ev100: asked.ev100 };
            let untouched = (Hdr, Tonemapping::None, DebandDither::Disabled, Msaa::Off);
            commands
                .entity(entity)
                .insert((picture, exposure, untouched));
        }
        if asked.hidden.iter().any(|hidden| hidden == name.as_str()) {
            commands.entity(entity).insert(Visibility::Hidden);
        }
    }
}

/// Changes the light as asked.
fn change(
    ready: On<LightmapsReady>,
    asked: Res<Asked>,
    mut scenes: Query<&mut LightControl>,
    mut complete: ResMut<Complete>,
) {
    let Ok(mut light) = scenes.get_mut(ready.event_target()) else {
        return;
    };
    let mut told = Vec::new();
    if !asked.state.is_empty() {
        told.extend(light.set_state(&asked.state, asked.seconds).err());
    }
    if let Some((group, [r, g, b], strength)) = &asked.group {
        told.extend(
            light
                .set_group(group, LinearRgba::rgb(*r, *g, *b), *strength)
                .err(),
        );
    }
    if let Some(error) = told.first() {
        eprintln!("{error}");
        process::exit(1);
    }
    complete.0 = Some(0);
}

/// Appends messages to a file.
fn report(
    mut problems: MessageReader<LightmapProblem>,
    answer: Res<Answer>,
    mut known: Local<Vec<String>>,
) {
    for problem in problems.read() {
        known.push(problem.text.clone());
        let text = serde_json::to_string(&*known).expect("JSON");
        fs::write(answer.0.join("problems.json"), text).expect("problems.json");
    }
}

/// Reads the picture some frames after the light is complete, which includes fades.
fn read_back(
    mut commands: Commands,
    asked: Res<Asked>,
    scenes: Query<&LightControl>,
    volumes: Query<&IrradianceVolume>,
    target: Res<Target>,
    mut complete: ResMut<Complete>,
) {
    if !asked.probes.is_empty() && !volumes.is_empty() {
        complete.0.get_or_insert(0);
    }
    let Some(frames) = &mut complete.0 else {
        return;
    };
    if scenes.iter().any(LightControl::is_fading) {
        return;
    }
    *frames += 1;
    if *frames == FRAMES {
        commands
            .spawn(Readback::texture(target.0.clone()))
            .observe(write);
    }
}

fn write(picture: On<ReadbackComplete>, answer: Res<Answer>) {
    fs::write(answer.0.join("pixels.bin"), &picture.data).expect("pixels.bin");
    process::exit(0);
}
