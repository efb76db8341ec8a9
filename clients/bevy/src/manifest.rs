//! The manifest `hemibake.json`, version 2, and the same keys in the extras of a glTF file.

use std::{collections::HashMap, fmt, marker::PhantomData};

use bevy::math::{Mat4, Rect, Vec2, Vec3};
use serde::{
    Deserialize, Deserializer,
    de::{MapAccess, Visitor},
};
use serde_json::Value;

/// Version of the manifest that this crate reads.
pub const VERSION: u64 = 2;

/// Name of the manifest file.
pub const MANIFEST: &str = "hemibake.json";

const GROUP: &str = "light_group ";

/// Outputs that are shown as the light of a surface, the first one that exists.
const SHOWN: [&str; 4] = ["combined", "direct", "indirect", "ambient_occlusion"];

/// JSON object in the order of the file.
#[derive(Clone, Debug, PartialEq)]
pub struct Ordered<T>(pub Vec<(String, T)>);

impl<T> Default for Ordered<T> {
    fn default() -> Self {
        Self(Vec::new())
    }
}

impl<T> Ordered<T> {
    /// Returns the value of a key.
    pub fn get(&self, key: &str) -> Option<&T> {
        self.0
            .iter()
            .find(|(name, _)| name == key)
            .map(|(_, value)| value)
    }

    /// Returns the keys in the order of the file.
    pub fn keys(&self) -> impl Iterator<Item = &str> {
        self.0.iter().map(|(name, _)| name.as_str())
    }
}

impl<'de, T: Deserialize<'de>> Deserialize<'de> for Ordered<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Entries<T>(PhantomData<T>);

        impl<'de, T: Deserialize<'de>> Visitor<'de> for Entries<T> {
            type Value = Ordered<T>;

            fn expecting(&self, text: &mut fmt::Formatter) -> fmt::Result {
                text.write_str("an object")
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Self::Value, A::Error> {
                let mut entries = Vec::new();
                while let Some(entry) = map.next_entry()? {
                    entries.push(entry);
                }
                Ok(Ordered(entries))
            }
        }
        deserializer.deserialize_map(Entries(PhantomData))
    }
}

/// Factors of light groups, strength × color, linear RGB, by state and group.
pub type States = Ordered<Ordered<[f32; 3]>>;

/// The parts of a manifest that this crate uses.
#[derive(Clone, Debug, Default, Deserialize)]
pub struct Manifest {
    /// Files by name, in the order in which they were written.
    pub lightmaps: Ordered<Entry>,
    /// Light states by name.
    #[serde(default)]
    pub states: States,
    /// Grids of light probes.
    #[serde(default)]
    pub probes: Vec<ProbeVolume>,
}

/// A file of the manifest. Pictures have no `output`.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(default)]
pub struct Entry {
    /// Scene whose light the file holds.
    pub scene: Option<String>,
    /// glTF file beside which the export has written the map.
    pub export: Option<String>,
    /// Name of the lightmap.
    pub atlas: String,
    /// Name of the output, as `combined` or `light_group Lamps`.
    pub output: String,
    /// Objects whose light the file holds.
    pub objects: Vec<ObjectPlace>,
    /// Format of the file, as `exr` or `rgbm`.
    pub format: String,
    /// Factor from decoded texels to light.
    pub intensity: Option<f32>,
    /// Exponent of RGBM and RGBD.
    pub gamma: Option<f32>,
    /// Formula from a texel to light, GLSL.
    pub decode_texel: Option<String>,
    /// Formula of a directional map.
    pub decode: Option<String>,
    /// File that this one is an exact copy of.
    pub shown_for: Option<String>,
}

/// An object in a lightmap: lightmap UV = UV × scale + offset, v up.
#[derive(Clone, Debug, Deserialize)]
pub struct ObjectPlace {
    /// Name of the object in Blender.
    pub object: String,
    /// Factor of the UVs.
    pub scale: f32,
    /// Offset of the scaled UVs.
    pub offset: [f32; 2],
}

/// A grid of light probes.
#[derive(Clone, Debug, Deserialize)]
pub struct ProbeVolume {
    /// Name of the volume in Blender.
    pub name: String,
    /// Rows of the matrix from the cube [-1, 1]³ to Blender's world space, m.
    pub matrix: [[f32; 4]; 4],
    /// File of ambient cubes.
    pub ktx2: Option<String>,
}

impl ProbeVolume {
    /// Returns the matrix from the cube [-½, ½]³ with y up to Bevy's world space.
    pub fn to_world(&self) -> Mat4 {
        // (x, y, z) of Blender is (x, z, -y) of Bevy.
        let y_up = Mat4::from_cols_array_2d(&[
            [1.0, 0.0, 0.0, 0.0],
            [0.0, 0.0, -1.0, 0.0],
            [0.0, 1.0, 0.0, 0.0],
            [0.0, 0.0, 0.0, 1.0],
        ]);
        let to_blender = Mat4::from_cols_array_2d(&self.matrix).transpose();
        y_up * to_blender * y_up.transpose() * Mat4::from_scale(Vec3::splat(2.0))
    }
}

/// Light groups and states in the extras of a glTF asset.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Extras {
    /// Names of the light groups.
    pub groups: Vec<String>,
    /// Light states.
    pub states: States,
}

/// A file of a lightmap.
#[derive(Clone, Debug)]
pub struct MapFile {
    /// Name of the file, relative to the manifest.
    pub file: String,
    /// Its entry in the manifest.
    pub entry: Entry,
}

/// Maps of one lightmap.
#[derive(Clone, Debug, Default)]
pub struct Atlas {
    /// Name of the lightmap.
    pub name: String,
    /// Map of all light.
    pub light: Option<MapFile>,
    /// Maps of the light groups by name.
    pub groups: Vec<(String, MapFile)>,
    /// Directional maps by output.
    pub directional: Vec<(String, MapFile)>,
}

/// Place of an object: its lightmap, and the rectangle of its UVs there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Place {
    /// Index of the atlas, and UV rectangle of [`bevy::pbr::Lightmap::uv_rect`].
    One(usize, Rect),
    /// Instances of the object have different places, which their name does not tell apart.
    Several,
}

/// Lightmaps of a glTF file, and the place of each object by name.
#[derive(Clone, Debug, Default)]
pub struct Lightmaps {
    /// The lightmaps.
    pub atlases: Vec<Atlas>,
    /// Places by object.
    pub places: HashMap<String, Place>,
}

/// Which UVs a glTF file holds in its second UV map.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LightmapUvs {
    /// Final lightmap UVs, as in files of *Export for Engine*.
    #[default]
    Final,
    /// UVs of the layer in Blender, as in files of Blender's own exporter. Scale and offset of the manifest apply.
    Layer,
}

/// Reads a manifest; returns a message if it is none, or of another version.
pub fn read_manifest(json: &[u8], name: &str) -> Result<Manifest, String> {
    #[derive(Deserialize)]
    struct Header {
        version: Option<Value>,
        lightmaps: Option<Value>,
    }
    let none = || format!("{name}: no manifest of lightmaps. Export again.");
    let header: Header = serde_json::from_slice(json).map_err(|_| none())?;
    if !header
        .lightmaps
        .is_some_and(|lightmaps| lightmaps.is_object())
    {
        return Err(none());
    }
    check_version(header.version.as_ref(), name)?;
    serde_json::from_slice(json)
        .map_err(|error| format!("{name}: not readable ({error}). Export again."))
}

/// Reads the JSON of the extras of a glTF asset; `None` without Hemibake's.
pub fn read_extras(json: &str, name: &str) -> Result<Option<Extras>, String> {
    #[derive(Deserialize)]
    struct AssetExtras {
        hemibake: Option<Keys>,
    }
    #[derive(Deserialize)]
    struct Keys {
        version: Option<Value>,
        #[serde(default)]
        groups: Vec<Group>,
        #[serde(default)]
        states: States,
    }
    #[derive(Deserialize)]
    struct Group {
        name: String,
    }
    let Ok(AssetExtras {
        hemibake: Some(keys),
    }) = serde_json::from_str(json)
    else {
        return Ok(None);
    };
    check_version(keys.version.as_ref(), name)?;
    Ok(Some(Extras {
        groups: keys.groups.into_iter().map(|group| group.name).collect(),
        states: keys.states,
    }))
}

fn check_version(version: Option<&Value>, name: &str) -> Result<(), String> {
    if version.and_then(Value::as_u64) == Some(VERSION) {
        return Ok(());
    }
    let shown = version.map_or("none".into(), Value::to_string);
    Err(format!(
        "{name}: version {shown} is unknown. Export with a Hemibake that writes version {VERSION}, or update bevy_hemibake."
    ))
}

/// Lists the maps of a glTF file: the maps that its export wrote, else the maps of a bake.
///
/// An atlas that several scenes have baked has the maps of the scene that was written last.
pub fn lightmaps_of(manifest: &Manifest, file: &str, uvs: LightmapUvs) -> Lightmaps {
    let all = || {
        let maps = manifest.lightmaps.0.iter();
        maps.filter(|(_, entry)| !entry.output.is_empty() && entry.shown_for.is_none())
    };
    let mut chosen: Vec<_> = all()
        .filter(|(_, entry)| entry.export.as_deref() == Some(file))
        .collect();
    if chosen.is_empty() {
        chosen = all().filter(|(_, entry)| entry.export.is_none()).collect();
    }
    let last_scenes: HashMap<_, _> = chosen
        .iter()
        .filter_map(|(_, entry)| Some((&entry.atlas, entry.scene.as_ref()?)))
        .collect();
    chosen.retain(|(_, entry)| {
        entry.scene.is_none() || last_scenes.get(&entry.atlas) == entry.scene.as_ref().as_ref()
    });
    let mut found = Lightmaps::default();
    for (name, entry) in chosen {
        found.add(
            MapFile {
                file: name.clone(),
                entry: entry.clone(),
            },
            uvs,
        );
    }
    found
}

impl Lightmaps {
    fn add(&mut self, map: MapFile, uvs: LightmapUvs) {
        let name = &map.entry.atlas;
        let index = self
            .atlases
            .iter()
            .position(|atlas| atlas.name == *name)
            .unwrap_or_else(|| {
                self.atlases.push(Atlas {
                    name: name.clone(),
                    ..Atlas::default()
                });
                self.atlases.len() - 1
            });
        for object in &map.entry.objects {
            let place = Place::One(index, object.uv_rect(uvs));
            let known = self.places.entry(object.object.clone()).or_insert(place);
            if *known != place {
                *known = Place::Several;
            }
        }
        self.atlases[index].add(map);
    }
}

impl Atlas {
    fn add(&mut self, map: MapFile) {
        if let Some(group) = map.entry.output.strip_prefix(GROUP) {
            self.groups.push((group.into(), map));
        } else if map.entry.decode.is_some() {
            self.directional.push((map.entry.output.clone(), map));
        } else if rank(&map) < self.light.as_ref().map_or(SHOWN.len(), rank) {
            self.light = Some(map);
        }
    }
}

impl ObjectPlace {
    /// Returns the rectangle that UVs of the glTF file, v down, are relative to.
    fn uv_rect(&self, uvs: LightmapUvs) -> Rect {
        if uvs == LightmapUvs::Final {
            return Rect::new(0.0, 0.0, 1.0, 1.0);
        }
        let least = Vec2::new(self.offset[0], 1.0 - self.scale - self.offset[1]);
        Rect::from_corners(least, least + self.scale)
    }
}

fn rank(map: &MapFile) -> usize {
    let output = map.entry.output.as_str();
    SHOWN
        .iter()
        .position(|shown| *shown == output)
        .unwrap_or(SHOWN.len())
}

#[cfg(test)]
mod tests {
    use super::*;

    const EXPORTED: &[u8] = include_bytes!("../../../tests/golden/manifest_exported.json");
    const BAKED: &[u8] = include_bytes!("../../../tests/golden/manifest_baked.json");

    fn read(json: &[u8]) -> Manifest {
        read_manifest(json, MANIFEST).unwrap()
    }

    fn with(change: impl FnOnce(&mut Value)) -> Vec<u8> {
        let mut json = serde_json::from_slice(BAKED).unwrap();
        change(&mut json);
        serde_json::to_vec(&json).unwrap()
    }

    fn groups(atlas: &Atlas) -> Vec<(&str, &str)> {
        let pairs = atlas.groups.iter();
        pairs
            .map(|(name, map)| (name.as_str(), map.file.as_str()))
            .collect()
    }

    #[test]
    fn an_export_has_its_maps_and_groups() {
        let found = lightmaps_of(&read(EXPORTED), "street.glb", LightmapUvs::Final);
        let [atlas] = &found.atlases[..] else {
            panic!("{found:?}")
        };
        assert_eq!(atlas.name, "Lightmap");
        assert_eq!(atlas.light.as_ref().unwrap().file, "street.Lightmap.exr");
        let wanted = [
            ("Lamps", "street.Lightmap light group Lamps.exr"),
            ("Sun", "street.Lightmap light group Sun.exr"),
        ];
        assert_eq!(groups(atlas), wanted);
        let directional: Vec<_> = atlas
            .directional
            .iter()
            .map(|(output, _)| output.as_str())
            .collect();
        assert_eq!(directional, ["L0", "L1 x", "L1 y", "L1 z"]);
        let whole = Place::One(0, Rect::new(0.0, 0.0, 1.0, 1.0));
        assert_eq!(
            found.places,
            HashMap::from([("Floor".into(), whole), ("Straße".into(), whole)])
        );
    }

    #[test]
    fn maps_of_another_export_are_left_out() {
        let found = lightmaps_of(&read(EXPORTED), "house.glb", LightmapUvs::Final);
        assert!(found.atlases.is_empty() && found.places.is_empty());
    }

    #[test]
    fn a_bake_has_its_maps_in_any_format_without_copies_and_pictures() {
        let found = lightmaps_of(&read(BAKED), "street.glb", LightmapUvs::Final);
        let light = found.atlases[0].light.as_ref().unwrap();
        assert_eq!(
            (light.file.as_str(), light.entry.format.as_str()),
            ("street_Lightmap.png", "rgbm")
        );
        assert_eq!(
            (light.entry.intensity, light.entry.gamma),
            (Some(34.4932), Some(2.2))
        );
        let names: Vec<_> = groups(&found.atlases[0])
            .into_iter()
            .map(|(name, _)| name)
            .collect();
        assert_eq!(names, ["Lamps", "Ungrouped"]);
    }

    #[test]
    fn uvs_of_a_layer_have_the_rectangle_of_the_object() {
        let found = lightmaps_of(&read(BAKED), "street.glb", LightmapUvs::Layer);
        assert_eq!(
            found.places["Floor"],
            Place::One(0, Rect::new(0.0, 0.0, 1.0, 1.0))
        );
        // Scale 0.25 and offset (0.5, 0.25) with v up.
        assert_eq!(
            found.places["Post"],
            Place::One(0, Rect::new(0.5, 0.5, 0.75, 0.75))
        );
    }

    #[test]
    fn instances_in_several_places_are_not_told_apart() {
        let twice = with(|json| {
            let objects = &mut json["lightmaps"]["street_Lightmap.png"]["objects"];
            let mut other = objects[1].clone();
            other["offset"] = serde_json::json!([0.0, 0.0]);
            objects.as_array_mut().unwrap().push(other);
        });
        let place = |uvs| lightmaps_of(&read(&twice), "street.glb", uvs).places["Post"];
        assert_eq!(place(LightmapUvs::Layer), Place::Several);
        assert!(matches!(place(LightmapUvs::Final), Place::One(0, _)));
        let elsewhere = with(|json| {
            json["lightmaps"]["street_Lightmap light_group Ungrouped.exr"]["atlas"] =
                "Other".into();
        });
        let found = lightmaps_of(&read(&elsewhere), "street.glb", LightmapUvs::Final);
        assert_eq!(found.places["Floor"], Place::Several);
    }

    #[test]
    fn the_scene_written_last_is_shown() {
        let json = br#"{"version": 2, "objects": [], "lightmaps": {
            "z.exr": {"scene": "Day", "atlas": "A", "output": "combined", "format": "exr", "objects": []},
            "b.exr": {"scene": "Day", "atlas": "A", "output": "light_group Sun", "format": "exr", "objects": []},
            "a.exr": {"scene": "Night", "atlas": "A", "output": "combined", "format": "exr", "objects": []}}}"#;
        let found = lightmaps_of(&read(json), "room.glb", LightmapUvs::Final);
        assert_eq!(found.atlases[0].light.as_ref().unwrap().file, "a.exr");
        assert!(found.atlases[0].groups.is_empty());
    }

    #[test]
    fn combined_light_goes_before_its_parts() {
        let json = br#"{"version": 2, "objects": [], "lightmaps": {
            "d.exr": {"atlas": "A", "output": "direct", "format": "exr", "objects": []},
            "c.exr": {"atlas": "A", "output": "combined", "format": "exr", "objects": []},
            "s.exr": {"atlas": "A", "output": "shadow_mask Sun", "format": "exr", "objects": []},
            "o.exr": {"atlas": "A", "superseded": "light_group Old", "format": "exr", "objects": []},
            "i.exr": {"atlas": "A", "output": "indirect", "format": "exr", "objects": []}}}"#;
        let found = lightmaps_of(&read(json), "room.glb", LightmapUvs::Final);
        assert_eq!(found.atlases[0].light.as_ref().unwrap().file, "c.exr");
        assert!(found.atlases[0].groups.is_empty());
    }

    #[test]
    fn states_keep_the_order_of_the_file() {
        let manifest = read(BAKED);
        assert_eq!(manifest.states.keys().collect::<Vec<_>>(), ["Night", "Day"]);
        let night = manifest.states.get("Night").unwrap();
        assert_eq!(night.get("Lamps"), Some(&[1.0, 0.8, 0.6]));
        assert_eq!(night.get("Ungrouped"), Some(&[0.0; 3]));
        assert!(manifest.states.get("Day").unwrap().0.is_empty());
    }

    #[test]
    fn other_versions_and_other_files_are_named() {
        let error = |json: &[u8]| read_manifest(json, "level/hemibake.json").unwrap_err();
        let newer = error(&with(|json| json["version"] = 9.into()));
        assert!(
            newer.starts_with("level/hemibake.json: version 9 is unknown."),
            "{newer}"
        );
        let older = error(&with(|json| {
            drop(json.as_object_mut().unwrap().remove("version"))
        }));
        assert!(older.contains("version none is unknown"), "{older}");
        for json in [&b"[1, 2]"[..], b"{\"version\": 2}", b"no JSON", b""] {
            assert!(
                error(json).contains("no manifest of lightmaps"),
                "{}",
                error(json)
            );
        }
    }

    #[test]
    fn extras_have_groups_and_states() {
        let json = r#"{"hemibake": {"version": 2, "groups": [{"name": "Sun", "output": "light_group Sun"}],
            "states": {"Night": {"Sun": [0, 0.5, 0]}}}, "other": 1}"#;
        let extras = read_extras(json, "room.glb").unwrap().unwrap();
        assert_eq!(extras.groups, ["Sun"]);
        assert_eq!(
            extras.states.get("Night").unwrap().get("Sun"),
            Some(&[0.0, 0.5, 0.0])
        );
        assert_eq!(read_extras("{\"other\": 1}", "room.glb"), Ok(None));
        assert_eq!(
            read_extras(r#"{"hemibake": {"version": 2}}"#, "room.glb"),
            Ok(Some(Extras::default()))
        );
        let error = read_extras(r#"{"hemibake": {"version": 3}}"#, "room.glb").unwrap_err();
        assert!(
            error.starts_with("room.glb: version 3 is unknown."),
            "{error}"
        );
    }

    #[test]
    fn probes_turn_to_y_up_with_twice_the_scale() {
        let manifest = read(EXPORTED);
        let to_world = manifest.probes[0].to_world();
        // Half sizes 2.5, 2 and 1.5 m around (0, 0, 1.5) in Blender.
        let corner = to_world.transform_point3(Vec3::splat(0.5));
        assert!(
            corner.abs_diff_eq(Vec3::new(2.5, 3.0, 2.0), 1e-6),
            "{corner}"
        );
        assert!(
            to_world
                .transform_point3(Vec3::ZERO)
                .abs_diff_eq(Vec3::new(0.0, 1.5, 0.0), 1e-6)
        );
    }
}
