import type { CubeTexture, Group, LoadingManager, Matrix4, Object3D, Vector3, WebGLRenderer } from 'three';
import { LightControl } from 'hemibake-manifest';
import type { LightProbeGridWebGL } from 'three/addons/lighting/LightProbeGridWebGL.js';
import type { GLTF } from 'three/addons/loaders/GLTFLoader.js';

export interface HemibakeLoaderOptions {
  /** 'inside' prefers the lightmaps in the file, 'beside' the files of hemibake.json. */
  maps?: 'inside' | 'beside';
  manager?: LoadingManager;
}

export class HemibakeLoader {
  constructor(renderer: WebGLRenderer, options?: HemibakeLoaderOptions);
  /** Rejects only if the glTF file itself cannot be read; other faults are in `problems`. */
  load(url: string): Promise<LightmappedScene>;
}

export class LightmappedScene extends LightControl {
  readonly gltf: GLTF;
  readonly scene: Group;
}

/** Light probe volumes of a hemibake.json as grids to add to a scene. Rejects if the manifest cannot be read. */
export function loadProbeGrids(url: string): Promise<{ grids: LightProbeGridWebGL[]; problems: string[] }>;

/** Box or unit sphere, from world space to the cube from -1 to 1. */
export interface ReflectionVolume {
  shape: 'box' | 'sphere';
  volume: number;
  toLocal: Matrix4;
}

/** Radiance around a point. Level k of `levels` has the roughness k / (levels - 1); look up (x, y, -z). */
export interface ReflectionCube {
  name: string;
  texture: CubeTexture;
  levels: number;
  position: Vector3;
  influence: ReflectionVolume;
  parallax: ReflectionVolume;
}

export class Reflections {
  readonly cubes: ReflectionCube[];
  constructor(cubes: ReflectionCube[]);
  /** Shows meshes below an object with the cubes around them; call it again after objects have moved. */
  apply(root: Object3D): void;
  /** The smallest cube around a point of world space. */
  cubeAt(point: Vector3): ReflectionCube | null;
  dispose(): void;
}

/** Reflection cubes of a hemibake.json. Rejects if the manifest cannot be read. */
export function loadReflections(
  url: string, renderer: WebGLRenderer, options?: { format?: 'ktx2' | 'exr' | 'hdr' },
): Promise<{ reflections: Reflections; problems: string[] }>;
