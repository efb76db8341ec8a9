//! Loads glTF files with Radiance HDR inside, which Bevy refuses.

use std::borrow::Cow;

use bevy::{
    app::{App, Plugin},
    asset::{AssetApp, AssetLoader, LoadContext, io::Reader},
    gltf::{
        DefaultGltfImageSampler, Gltf, GltfError, GltfLoader, GltfLoaderSettings,
        extensions::GltfExtensionHandlers,
    },
    image::{CompressedImageFormatSupport, CompressedImageFormats},
    reflect::TypePath,
};
use serde_json::{Map, Value};

/// Plug-in that loads glTF files with lightmaps in Radiance HDR (`MOZ_texture_rgbe`), as exported for three.js. Needs the
/// feature `hdr`; add it after `DefaultPlugins`.
///
/// Its loader takes the place of Bevy's loader of .glb and .gltf files; Bevy warns once that there are two. Custom vertex
/// attributes and coordinates of `GltfPlugin` do not apply.
pub struct HdrInsidePlugin;

impl Plugin for HdrInsidePlugin {
    fn build(&self, _: &mut App) {}

    // Bevy's own loader is registered here as well.
    fn finish(&self, app: &mut App) {
        let world = app.world();
        let formats = world.get_resource::<CompressedImageFormatSupport>();
        let loader = GltfLoader {
            supported_compressed_formats: formats
                .map_or(CompressedImageFormats::NONE, |formats| formats.0),
            custom_vertex_attributes: Default::default(),
            default_sampler: world.resource::<DefaultGltfImageSampler>().get_internal(),
            default_convert_coordinates: Default::default(),
            extensions: world.resource::<GltfExtensionHandlers>().0.clone(),
        };
        app.register_asset_loader(HdrGltfLoader(loader));
    }
}

/// Bevy's loader, for files whose textures have sources.
#[derive(TypePath)]
struct HdrGltfLoader(GltfLoader);

impl AssetLoader for HdrGltfLoader {
    type Asset = Gltf;
    type Settings = GltfLoaderSettings;
    type Error = GltfError;

    async fn load(
        &self,
        reader: &mut dyn Reader,
        settings: &GltfLoaderSettings,
        context: &mut LoadContext<'_>,
    ) -> Result<Gltf, GltfError> {
        let mut bytes = Vec::new();
        reader.read_to_end(&mut bytes).await?;
        GltfLoader::load_gltf(&self.0, &with_sources(&bytes), context, settings).await
    }

    fn extensions(&self) -> &[&str] {
        &["gltf", "glb"]
    }
}

/// Length of the header of a .glb file, and of the header of a chunk, bytes (glTF 2.0, section 4.4).
const HEADER: usize = 12;
const CHUNK: usize = 8;

/// Returns a .glb or .gltf file in which each texture of `MOZ_texture_rgbe` has its image as source; unchanged if there is
/// none, or if the file is neither.
fn with_sources(bytes: &[u8]) -> Cow<'_, [u8]> {
    if !bytes.starts_with(b"glTF") {
        return patched(bytes).map_or(Cow::Borrowed(bytes), Cow::Owned);
    }
    let length = bytes
        .get(HEADER..HEADER + 4)
        .and_then(|length| length.try_into().ok());
    let start = HEADER + CHUNK;
    let end = length.map(|length| start.saturating_add(u32::from_le_bytes(length) as usize));
    let Some(mut json) = end.and_then(|end| patched(bytes.get(start..end)?)) else {
        return Cow::Borrowed(bytes);
    };
    json.resize(json.len().next_multiple_of(4), b' ');
    let rest = &bytes[end.expect("the end of the JSON chunk")..];
    let size = |length: usize| (length as u32).to_le_bytes();
    let total = size(start + json.len() + rest.len());
    let length = size(json.len());
    Cow::Owned(
        [
            &bytes[..8],
            &total,
            &length,
            &bytes[HEADER + 4..start],
            &json,
            rest,
        ]
        .concat(),
    )
}

/// Returns the JSON with sources; None if nothing changes.
fn patched(json: &[u8]) -> Option<Vec<u8>> {
    let mut root: Value = serde_json::from_slice(json).ok()?;
    let textures = root.get_mut("textures")?.as_array_mut()?;
    let mut is_changed = false;
    for texture in textures.iter_mut().filter_map(Value::as_object_mut) {
        if let Some(source) = missing_source(texture) {
            texture.insert("source".into(), source);
            is_changed = true;
        }
    }
    if is_changed {
        serde_json::to_vec(&root).ok()
    } else {
        None
    }
}

fn missing_source(texture: &Map<String, Value>) -> Option<Value> {
    let extension = texture.get("extensions")?.get("MOZ_texture_rgbe")?;
    if texture.contains_key("source") {
        None
    } else {
        extension.get("source").cloned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const JSON: &str = r#"{"asset":{"version":"2.0"},"textures":[{"source":0},{"extensions":{"MOZ_texture_rgbe":{"source":1}}}]}"#;

    fn glb(json: &str) -> Vec<u8> {
        let json = format!(
            "{json}{}",
            " ".repeat(json.len().next_multiple_of(4) - json.len())
        );
        let binary = [1u8, 2, 3, 4];
        let length = |length: usize| (length as u32).to_le_bytes();
        let chunks = [
            &length(json.len())[..],
            b"JSON",
            json.as_bytes(),
            &length(binary.len()),
            b"BIN\0",
            &binary,
        ];
        let chunks = chunks.concat();
        [
            &b"glTF"[..],
            &2u32.to_le_bytes(),
            &length(HEADER + chunks.len()),
            &chunks,
        ]
        .concat()
    }

    #[test]
    fn textures_of_radiance_hdr_get_their_source() {
        let read: Value = serde_json::from_slice(&with_sources(JSON.as_bytes())).unwrap();
        assert_eq!(read["textures"][0]["source"], 0);
        assert_eq!(read["textures"][1]["source"], 1);
    }

    #[test]
    fn a_glb_file_keeps_its_other_chunks() {
        let made = with_sources(&glb(JSON)).into_owned();
        assert_eq!(
            u32::from_le_bytes(made[8..12].try_into().unwrap()) as usize,
            made.len()
        );
        let length = u32::from_le_bytes(made[12..16].try_into().unwrap()) as usize;
        assert_eq!(length % 4, 0);
        let read: Value = serde_json::from_slice(&made[20..20 + length]).unwrap();
        assert_eq!(read["textures"][1]["source"], 1);
        assert_eq!(
            made[20 + length..],
            [&4u32.to_le_bytes()[..], b"BIN\0", &[1, 2, 3, 4]].concat()
        );
    }

    #[test]
    fn other_files_stay_as_they_are() {
        let plain = r#"{"textures":[{"source":0}]}"#;
        for bytes in [
            &glb(plain)[..],
            plain.as_bytes(),
            b"glTF",
            b"glTF\x02\0\0\0\0\0\0\0\xff\xff\xff\xffJSON{}",
            b"",
        ] {
            assert!(matches!(with_sources(bytes), Cow::Borrowed(_)), "{bytes:?}");
        }
    }
}
