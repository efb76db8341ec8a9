//! Shows an exported glTF file with its lightmaps, as docs/engines/bevy.md describes, and writes the pixels to a file.

use std::{collections::HashMap, env, fs, path::PathBuf, process, time::Duration};

use bevy::{
    app::ScheduleRunnerPlugin,
    camera::RenderTarget,
    core_pipeline::tonemapping::{DebandDither, Tonemapping},
    ecs::system::SystemParam,
    gltf::{GltfMesh, GltfNode},
    pbr::{ExtendedMaterial, Lightmap, MaterialExtension},
    prelude::*,
    render::{
        RenderPlugin,
        gpu_readback::{Readback, ReadbackComplete},
        render_resource::{AsBindGroup, TextureFormat, TextureUsages},
        view::Hdr,
    },
    shader::ShaderRef,
};
use serde_json::Value;

/// Exposure of cameras that say none (`Exposure::EV100_BLENDER`), and frames until everything is drawn.
const EV100: f32 = 9.7;
const FRAMES: usize = 40;

/// What to show: a file, the size of the picture, the node of the camera and its field of view, names of hidden
/// nodes, and maps of each object by their outputs.
#[derive(Resource)]
struct Asked {
    folder: PathBuf,
    file: String,
    size: UVec2,
    camera: String,
    fov: f32,
    hidden: Vec<String>,
    directional: bool,
    maps: HashMap<String, HashMap<String, String>>,
}

#[derive(Resource)]
struct File(Handle<Gltf>);

#[derive(Resource)]
struct Target(Handle<Image>);

/// Images by the names of their files.
#[derive(Resource)]
struct Maps(HashMap<String, Handle<Image>>);

/// The maps of Directional.
#[derive(Asset, AsBindGroup, Reflect, Clone, Debug)]
struct Directional {
    #[texture(100)]
    #[sampler(101)]
    l0: Handle<Image>,
    #[texture(102)]
    l1_x: Handle<Image>,
    #[texture(103)]
    l1_y: Handle<Image>,
    #[texture(104)]
    l1_z: Handle<Image>,
}

impl MaterialExtension for Directional {
    fn fragment_shader() -> ShaderRef {
        "directional.wgsl".into()
    }
}

type DirectionalMaterial = ExtendedMaterial<StandardMaterial, Directional>;

fn main() {
    let folder = PathBuf::from(env::args().nth(1).expect("the folder of the file"));
    let assets = AssetPlugin {
        file_path: folder.to_string_lossy().into(),
        ..default()
    };
    let renders = RenderPlugin {
        synchronous_pipeline_compilation: true,
        ..default()
    };
    App::new()
        .add_plugins(DefaultPlugins.set(assets).set(renders))
        .add_plugins(MaterialPlugin::<DirectionalMaterial>::default())
        .add_plugins(ScheduleRunnerPlugin::run_loop(Duration::from_millis(1)))
        .insert_resource(ClearColor(Color::BLACK))
        .insert_resource(GlobalAmbientLight {
            brightness: 0.0,
            ..default()
        })
        .insert_resource(read(folder))
        .add_systems(Startup, load)
        .add_systems(Update, (show, read_back))
        .run();
}

fn read(folder: PathBuf) -> Asked {
    let text = fs::read_to_string(folder.join("show.json")).expect("show.json");
    let known: Value = serde_json::from_str(&text).expect("JSON");
    let number = |name: &str| known[name].as_u64().expect("a number") as u32;
    Asked {
        file: word(&known["file"]),
        size: UVec2::new(number("width"), number("height")),
        camera: word(&known["camera"]),
        fov: known["fov"].as_f64().expect("a number") as f32,
        hidden: known["hidden"]
            .as_array()
            .expect("a list")
            .iter()
            .map(word)
            .collect(),
        directional: known["directional"].as_bool().expect("true or false"),
        maps: table(&known["maps"], |maps| table(maps, word)),
        folder,
    }
}

fn word(value: &Value) -> String {
    value.as_str().expect("a string").into()
}

fn table<T>(value: &Value, each: impl Fn(&Value) -> T) -> HashMap<String, T> {
    let pairs = value.as_object().expect("an object").iter();
    pairs
        .map(|(name, inner)| (name.clone(), each(inner)))
        .collect()
}

fn load(
    mut commands: Commands,
    asked: Res<Asked>,
    assets: Res<AssetServer>,
    mut images: ResMut<Assets<Image>>,
) {
    commands.insert_resource(File(assets.load(asked.file.clone())));
    let files = asked.maps.values().flat_map(HashMap::values);
    let loaded = files
        .map(|file| (file.clone(), assets.load(file.clone())))
        .collect();
    commands.insert_resource(Maps(loaded));
    let mut target =
        Image::new_target_texture(asked.size.x, asked.size.y, TextureFormat::Rgba16Float, None);
    target.texture_descriptor.usage |= TextureUsages::COPY_SRC;
    commands.insert_resource(Target(images.add(target)));
}

/// What is in the file, and where new things go.
#[derive(SystemParam)]
struct Stage<'w, 's> {
    commands: Commands<'w, 's>,
    asked: Res<'w, Asked>,
    maps: Res<'w, Maps>,
    target: Res<'w, Target>,
    files: Res<'w, Assets<Gltf>>,
    nodes: Res<'w, Assets<GltfNode>>,
    meshes: Res<'w, Assets<GltfMesh>>,
    materials: ResMut<'w, Assets<StandardMaterial>>,
    directional: ResMut<'w, Assets<DirectionalMaterial>>,
}

/// Show all nodes once everything is loaded.
fn show(mut stage: Stage, assets: Res<AssetServer>, file: Res<File>, mut shown: Local<bool>) {
    let loaded = assets.is_loaded_with_dependencies(&file.0)
        && stage
            .maps
            .0
            .values()
            .all(|map| assets.is_loaded_with_dependencies(map));
    if *shown || !loaded {
        return;
    }
    *shown = true;
    let all = stage.files.get(&file.0).expect("the file").nodes.clone();
    let below: Vec<_> = all
        .iter()
        .filter_map(|node| stage.nodes.get(node))
        .flat_map(|node| node.children.clone())
        .collect();
    for root in all.iter().filter(|node| !below.contains(node)) {
        stage.show(root, Transform::IDENTITY);
    }
}

impl Stage<'_, '_> {
    fn show(&mut self, handle: &Handle<GltfNode>, above: Transform) {
        let node = self.nodes.get(handle).expect("a node").clone();
        let place = above.mul_transform(node.transform);
        if node.name == self.asked.camera {
            self.look(place);
        }
        if let Some(mesh) = node
            .mesh
            .as_ref()
            .filter(|_| !self.asked.hidden.contains(&node.name))
        {
            for primitive in self.meshes.get(mesh).expect("a mesh").primitives.clone() {
                let material = primitive.material.expect("a material");
                self.light_up(&node.name, place, primitive.mesh, material);
            }
        }
        for child in &node.children {
            self.show(child, place);
        }
    }

    fn look(&mut self, place: Transform) {
        let lens = PerspectiveProjection {
            fov: self.asked.fov,
            ..default()
        };
        let picture = RenderTarget::Image(self.target.0.clone().into());
        let untouched = (Hdr, Tonemapping::None, DebandDither::Disabled, Msaa::Off);
        self.commands.spawn((
            Camera3d::default(),
            Projection::Perspective(lens),
            picture,
            untouched,
            place,
        ));
    }

    /// Show a mesh by the maps of its object.
    fn light_up(
        &mut self,
        name: &str,
        place: Transform,
        mesh: Handle<Mesh>,
        material: Handle<StandardMaterial>,
    ) {
        let plain = self.materials.get_mut(&material).expect("a material");
        let mut shown = self.commands.spawn((Mesh3d(mesh), place));
        let Some(files) = self.asked.maps.get(name) else {
            shown.insert(MeshMaterial3d(material));
            return;
        };
        let map = |output: &str| self.maps.0[&files[output]].clone();
        if self.asked.directional && plain.normal_map_texture.is_some() {
            let extension = Directional {
                l0: map("l0"),
                l1_x: map("l1_x"),
                l1_y: map("l1_y"),
                l1_z: map("l1_z"),
            };
            let lit = DirectionalMaterial {
                base: plain.clone(),
                extension,
            };
            shown.insert(MeshMaterial3d(self.directional.add(lit)));
        } else {
            plain.lightmap_exposure = 1.2 * f32::exp2(EV100);
            shown.insert((
                MeshMaterial3d(material),
                Lightmap {
                    image: map("combined"),
                    ..default()
                },
            ));
        }
    }
}

/// Read the picture some frames after the camera is there.
fn read_back(
    mut commands: Commands,
    cameras: Query<&Camera3d>,
    target: Res<Target>,
    mut frames: Local<usize>,
) {
    *frames += cameras.iter().count();
    if *frames == FRAMES {
        commands
            .spawn(Readback::texture(target.0.clone()))
            .observe(write);
    }
}

fn write(picture: On<ReadbackComplete>, asked: Res<Asked>) {
    fs::write(asked.folder.join("pixels.bin"), &picture.data).expect("pixels.bin");
    process::exit(0);
}
