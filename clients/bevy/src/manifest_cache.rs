//! Manifests of folders, each read once.

use std::{collections::HashMap, sync::Arc};

use bevy::{
    asset::{
        AssetPath, AssetServer, AssetServerMode, AsyncReadExt,
        io::{AssetReaderError, ErasedAssetReader},
    },
    ecs::prelude::*,
    tasks::{IoTaskPool, Task, futures::check_ready},
};

use crate::manifest::{MANIFEST, Manifest, read_manifest};

/// Manifests by path.
#[derive(Resource, Default)]
pub(crate) struct ManifestCache(HashMap<AssetPath<'static>, State>);

enum State {
    Reading(Task<ManifestFile>),
    Done(ManifestFile),
}

/// What was found at the path of a manifest.
#[derive(Clone)]
pub(crate) enum ManifestFile {
    Read(Arc<Manifest>),
    /// Reason.
    Missing(String),
    /// Message.
    Faulty(String),
}

impl ManifestCache {
    /// Returns a manifest; None while it is being read.
    pub fn get(&mut self, server: &AssetServer, path: &AssetPath<'static>) -> Option<ManifestFile> {
        let state = self.0.entry(path.clone()).or_insert_with(|| {
            State::Reading(IoTaskPool::get().spawn(read(server.clone(), path.clone())))
        });
        if let State::Reading(task) = state {
            *state = State::Done(check_ready(task)?);
        }
        match state {
            State::Done(file) => Some(file.clone()),
            State::Reading(_) => None,
        }
    }
}

/// Reads a manifest. The asset server would log an error for every glTF file without one.
async fn read(server: AssetServer, path: AssetPath<'static>) -> ManifestFile {
    let bytes = match reader(&server, &path) {
        Ok(reader) => read_bytes(reader, &path).await,
        Err(reason) => Err(reason),
    };
    let name = path
        .path()
        .file_name()
        .map_or(MANIFEST.into(), |name| name.to_string_lossy());
    match bytes {
        Ok(bytes) => match read_manifest(&bytes, &name) {
            Ok(manifest) => ManifestFile::Read(Arc::new(manifest)),
            Err(problem) => ManifestFile::Faulty(problem),
        },
        Err(reason) => ManifestFile::Missing(reason),
    }
}

fn reader<'a>(
    server: &'a AssetServer,
    path: &AssetPath<'static>,
) -> Result<&'a dyn ErasedAssetReader, String> {
    let source = server
        .get_source(path.source())
        .map_err(|error| error.to_string())?;
    match server.mode() {
        AssetServerMode::Unprocessed => Ok(source.reader()),
        AssetServerMode::Processed => source.processed_reader().map_err(|error| error.to_string()),
    }
}

async fn read_bytes(
    reader: &dyn ErasedAssetReader,
    path: &AssetPath<'static>,
) -> Result<Vec<u8>, String> {
    let told = |error: AssetReaderError| error.to_string();
    let mut bytes = Vec::new();
    let mut file = reader.read(path.path()).await.map_err(told)?;
    file.read_to_end(&mut bytes)
        .await
        .map_err(|error| error.to_string())?;
    Ok(bytes)
}
