// Reflection cubes of hemibake.json: cube maps with prefiltered levels, shown with box projection.

import {
  CubeTexture, DataTexture, HalfFloatType, LinearFilter, LinearMipmapLinearFilter, LoaderUtils, Matrix4, NoColorSpace,
  Sphere, Vector3,
} from 'three';
import { EXRLoader } from 'three/addons/loaders/EXRLoader.js';
import { HDRLoader } from 'three/addons/loaders/HDRLoader.js';
import { KTX2Loader } from 'three/addons/loaders/KTX2Loader.js';
import { fileUrl, readManifest } from 'hemibake-manifest';
import { showReflection } from './reflection_shader.js';

/** Formats of cube files, the preferred one first. */
const FORMATS = ['ktx2', 'exr', 'hdr'];

/** Turns (x, y, z) of Blender into (x, z, -y) of three.js. */
const Y_UP = new Matrix4().set(1, 0, 0, 0, 0, 0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 1);

/**
 * Loads the reflection cubes of the manifest at a URL. Returns { reflections, problems }. Rejects if the manifest cannot
 * be read.
 *
 * format: 'ktx2', 'exr' or 'hdr'; by default the first of these that a cube has
 */
export async function loadReflections(url, renderer, { format } = {}) {
  const answer = await fetch(url), base = LoaderUtils.extractUrlBase(url);
  if (!answer.ok) throw new Error(`'${url}': not readable (status ${answer.status}).`);
  const { manifest, problems } = readManifest(await answer.json(), url), cubes = [];
  for (const entry of manifest.reflections) {
    try {
      cubes.push(await loadCube(base, entry, renderer, format ? [format] : FORMATS));
    } catch (error) {
      problems.push(`Reflection cube '${entry.name}': ${error.message ?? error}`);
    }
  }
  for (const problem of problems) console.warn(problem);
  return { reflections: new Reflections(cubes), problems };
}

/** Reflection cubes of a scene; `cubes` lists { name, texture, levels, position, influence, parallax }. */
export class Reflections {
  #materials = new Map();

  constructor(cubes) {
    this.cubes = cubes;
  }

  /**
   * Shows each mesh below an object with the cube whose influence volume contains the middle of the mesh, the smallest
   * one if there are several. Call it again after objects have moved. Materials are cloned, once for each cube.
   */
  apply(root) {
    root.updateWorldMatrix(true, true);
    root.traverse(mesh => {
      if (!mesh.isMesh) return;
      const cube = this.cubeAt(middleOf(mesh)), of = material => this.#materialFor(material, cube);
      mesh.material = Array.isArray(mesh.material) ? mesh.material.map(of) : of(mesh.material);
    });
  }

  /** Returns the cube for a point of world space, or null. */
  cubeAt(point) {
    const inside = this.cubes.filter(({ influence }) => contains(influence, point));
    return inside.sort((a, b) => a.influence.volume - b.influence.volume)[0] ?? null;
  }

  dispose() {
    for (const { texture } of this.cubes) texture.dispose();
    for (const byCube of this.#materials.values()) for (const material of byCube.values()) material.dispose();
    this.#materials.clear();
  }

  #materialFor(shown, cube) {
    const material = shown.userData.hemibakeOriginal ?? shown;
    if (!cube || !material.isMeshStandardMaterial) return material;
    if (!this.#materials.has(material)) this.#materials.set(material, new Map());
    const byCube = this.#materials.get(material);
    if (!byCube.has(cube)) byCube.set(cube, showReflection(material, cube));
    return byCube.get(cube);
  }
}

async function loadCube(base, entry, renderer, formats) {
  const { name, files, size, roughness, position } = entry;
  const format = formats.find(ending => files.some(file => file.endsWith(`.${ending}`)));
  if (!format || !roughness) throw new Error(`no file of format ${formats.join(', ')}. Bake again.`);
  const file = files.find(other => other.endsWith(`.${format}`)), url = base + fileUrl(file);
  const read = format === 'ktx2' ? readKtx2(url, renderer) : readStrip(url, format, size, roughness.length);
  const levels = await read.catch(error => {
    throw new Error(`'${file}' is not readable (${error.message ?? error}). Put it beside the manifest, or bake again.`);
  });
  if (levels.length !== roughness.length || levels[0][0].image.width !== size) {
    throw new Error(`'${file}' has other levels than the manifest. Bake again.`);
  }
  return {
    name, texture: cubeTexture(levels), levels: levels.length, position: new Vector3(...position).applyMatrix4(Y_UP),
    influence: volume(entry.influence), parallax: volume(entry.parallax),
  };
}

// KTX2Loader of three.js 0.187 returns all six faces of an uncompressed level as one array.
async function readKtx2(url, renderer) {
  const loader = new KTX2Loader().detectSupport(renderer), { mipmaps, format, type } = await loader.loadAsync(url);
  loader.dispose();
  return mipmaps.map(({ data, width, height }) => faces(face => {
    const length = data.length / 6;
    return new DataTexture(data.subarray(face * length, (face + 1) * length), width, height, format, type);
  }));
}

async function readStrip(url, format, size, count) {
  const loader = format === 'exr' ? new EXRLoader() : new HDRLoader();
  const { image, format: channels } = await loader.setDataType(HalfFloatType).loadAsync(url);
  if (image.width !== 6 * size) throw new Error(`${image.width} pixels wide instead of ${6 * size}`);
  // EXRLoader puts the top row last.
  const row = y => (format === 'exr' ? image.height - 1 - y : y) * image.width;
  let top = 0;
  return Array.from({ length: count }, (_, level) => {
    const width = size >> level, first = top;
    top += width;
    return faces(face => {
      const data = new Uint16Array(4 * width * width);
      for (let y = 0; y < width; y++) {
        const start = 4 * (row(first + y) + face * width);
        data.set(image.data.subarray(start, start + 4 * width), 4 * y * width);
      }
      return new DataTexture(data, width, width, channels, HalfFloatType);
    });
  });
}

const faces = make => Array.from({ length: 6 }, (_, face) => make(face));

function cubeTexture(levels) {
  const [first, ...others] = levels;
  for (const face of levels.flat()) face.needsUpdate = true;
  const texture = new CubeTexture(first);
  texture.mipmaps = others.map(level => ({ image: level.map(face => ({ image: face.image })) }));
  return Object.assign(texture, {
    format: first[0].format, type: first[0].type, colorSpace: NoColorSpace, generateMipmaps: false, flipY: false,
    magFilter: LinearFilter, minFilter: LinearMipmapLinearFilter, needsUpdate: true,
  });
}

// Rows of a matrix from the unit cube to Blender's world space.
function volume({ shape, matrix }) {
  const toWorld = new Matrix4().set(...matrix.flat()).premultiply(Y_UP);
  return { shape, volume: Math.abs(toWorld.determinant()), toLocal: toWorld.clone().invert() };
}

function contains({ shape, toLocal }, point) {
  const { x, y, z } = point.clone().applyMatrix4(toLocal);
  return shape === 'box' ? Math.max(Math.abs(x), Math.abs(y), Math.abs(z)) <= 1 : Math.hypot(x, y, z) <= 1;
}

function middleOf(mesh) {
  if (!mesh.geometry.boundingSphere) mesh.geometry.computeBoundingSphere();
  return new Sphere().copy(mesh.geometry.boundingSphere).applyMatrix4(mesh.matrixWorld).center;
}
