// The manifest beside a glTF file, and the files that it lists.

import { decoder, lightmapsOf, readManifest } from './manifest.js';

export const MANIFEST = 'hemibake.json';

/**
 * Reads the manifest in a folder. Returns { atlases, atlasOf, states, problems }, see lightmapsOf.
 *
 * base:        URL of the folder, with a slash at its end
 * file:        name of the glTF file
 * isOptional:  true if a missing manifest is no problem
 */
export async function readBeside(base, file, isOptional) {
  let json;
  try {
    json = await (await fetched(`${base}${MANIFEST}`)).json();
  } catch (error) {
    const problem = `${MANIFEST}: not readable (${error.message}). Put it beside '${file}', or export with lightmaps inside.`;
    return { atlases: new Map(), atlasOf: new Map(), states: {}, problems: isOptional ? [] : [problem] };
  }
  const { manifest, problems } = readManifest(json, MANIFEST);
  return { ...lightmapsOf(manifest, file), states: manifest.states, problems };
}

/** Returns a map { bytes, mime, decode, intensity } of a file of the manifest; throws an Error that says why not. */
export async function readMap(base, { file, entry }) {
  if (!['hdr', 'png', 'rgbm', 'rgbd', 'logluv'].includes(entry.format)) {
    throw new Error(`this loader does not read the format ${entry.format}`);
  }
  const answer = await fetched(base + fileUrl(file));
  const mime = entry.format === 'hdr' ? 'image/vnd.radiance' : 'image/png';
  return { bytes: new Uint8Array(await answer.arrayBuffer()), mime, decode: decoder(entry), intensity: entry.intensity };
}

/** Returns the path of a file of the manifest as part of a URL. */
export function fileUrl(file) {
  return file.split('/').map(encodeURIComponent).join('/');
}

async function fetched(url) {
  const answer = await fetch(url);
  if (!answer.ok) throw new Error(`status ${answer.status}`);
  return answer;
}
