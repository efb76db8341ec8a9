import type { CubeTexture, Group, Light, LoadingManager, Matrix4, Object3D, Vector3, WebGLRenderer } from 'three';
import { LightControl, type Factor, type MixedLightmap } from 'hemibake-manifest';
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

/** Light probe volumes as grids to add to a scene; `room.add(probes)` lets a LightmappedScene change their light. */
export class ProbeGrids extends LightControl implements MixedLightmap {
  readonly grids: Light[];
  mix(factors: Map<string, Factor>): void;
  /** Lets materials look up the grids at their points, as Blender's preview does. For WebGLRenderer. */
  apply(root: Object3D): void;
}

/**
 * Light probe volumes of a hemibake.json. Rejects if the manifest cannot be read.
 *
 * Grid: LightProbeGrid of three/addons for WebGPURenderer; LightProbeGridWebGL by default
 */
export function loadProbeGrids(
  url: string, options?: { Grid?: new (...sizes: number[]) => Light },
): Promise<ProbeGrids>;

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
